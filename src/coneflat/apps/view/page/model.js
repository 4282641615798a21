// A flattened mesh: its arrays and queries on them. Points of the layout are centred at the origin.

const ARRAY_TYPES = {f4: Float32Array, u4: Uint32Array, i4: Int32Array, u2: Uint16Array, u1: Uint8Array};

/** Return the model in a page: `head` is an object, `text` the compressed arrays in base64. */
async function unpackModel(head, text) {
  const packed = Uint8Array.fromBase64 ? Uint8Array.fromBase64(text) : bytesOfBase64(text);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return modelOf(head, await new Response(stream).arrayBuffer(), 0);
}

/** Return the model whose arrays are in a block of bytes from an offset on, a multiple of four; missing arrays are shared with another model. */
function modelOf(head, block, begin, other) {
  const arrays = {};
  for (const {name, type, offset, count} of head.arrays) {
    arrays[name] = offset === null ? other.arrays[name] : new ARRAY_TYPES[type](block, begin + offset, count);
  }
  return new Model(head, arrays);
}

function bytesOfBase64(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

class Model {
  constructor(head, arrays) {
    this.head = head;
    this.arrays = arrays;
    this.triangleCount = arrays.faces.length / 3;
    this.seamCount = head.seams;
    this.coneCount = arrays.cones.length;
    const [low, high] = [head.uv_low, head.uv_high];
    this.uvCentre = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.uvUnit = 2 / (Math.max(high[0] - low[0], high[1] - low[1]) || 1);
    this.conePoints = this.findConePoints();
  }

  /** Return the vertex of a corner, 3 * triangle + 0, 1, 2. */
  vertexAt(corner) {
    return this.arrays.point_vertex[this.arrays.faces[corner]];
  }

  place(vertex) {
    const places = this.arrays.places;
    return [places[3 * vertex], places[3 * vertex + 1], places[3 * vertex + 2]];
  }

  /** Return the position at which a point of the layout is drawn: in a plane, centred at the origin. */
  flatPlace(point) {
    return this.planePlace(this.arrays.uv[2 * point], this.arrays.uv[2 * point + 1]);
  }

  planePlace(u, v) {
    return [(u - this.uvCentre[0]) * this.uvUnit, (v - this.uvCentre[1]) * this.uvUnit, 0];
  }

  /** Return the two corners at the ends of the i-th half-edge on the outlines of charts. */
  outlineCorners(i) {
    const halfedge = this.arrays.outline[i];
    const base = halfedge - (halfedge % 3);
    return [base + ((halfedge + 1 - base) % 3), base + ((halfedge + 2 - base) % 3)];
  }

  /** Return the place of the corner opposite the i-th half-edge on the outlines of charts, in space or in the layout. */
  oppositePlace(i, inPlane) {
    const corner = this.arrays.outline[i];
    return inPlane ? this.flatPlace(this.arrays.faces[corner]) : this.place(this.vertexAt(corner));
  }

  /** Return the polygons or segments of a thing, in space or in the layout, as lists of points. */
  shapeOf(thing, inPlane) {
    const at = (corner) => (inPlane ? this.flatPlace(this.arrays.faces[corner]) : this.place(this.vertexAt(corner)));
    if (thing.kind === "triangle") return [[0, 1, 2].map((k) => at(3 * thing.index + k))];
    if (thing.kind === "seam") {
      const sides = inPlane ? [2 * thing.index, 2 * thing.index + 1] : [2 * thing.index];
      return sides.map((side) => this.outlineCorners(side).map(at));
    }
    if (!inPlane) return [[this.place(this.arrays.cones[thing.index])]];
    return this.conePoints[thing.index].map((point) => [this.flatPlace(point)]);
  }

  /** Return the edges of each seam. */
  get seams() {
    if (!this.seamEdges) {
      this.seamEdges = [];
      this.arrays.seam_numbers.forEach((seam, edge) => (this.seamEdges[seam] ??= []).push(edge));
    }
    return this.seamEdges;
  }

  /** Return the edges of the whole seam that a seam edge belongs to. */
  edgesOfSeam(edge) {
    return this.seams[this.arrays.seam_numbers[edge]];
  }

  /** Return the name at a seam edge, of its seam or of a part of it; nothing if seams have no names. */
  nameAt(edge) {
    return this.head.parts?.names[this.arrays.edge_names[edge]];
  }

  /** Return an edge of each part of the seam of an edge that has a name: in the middle of the part, that of the edge first. */
  namedEdges(edge) {
    if (!this.head.parts) return [];
    const parts = new Map([[this.nameAt(edge), []]]);
    for (const index of this.edgesOfSeam(edge)) {
      const name = this.nameAt(index);
      if (!parts.has(name)) parts.set(name, []);
      parts.get(name).push(index);
    }
    return Array.from(parts.values(), (edges) => this.middleOf(edges));
  }

  /** Return the edge in the middle of the seam of an edge. */
  middleOfSeam(edge) {
    return this.middleOf(this.edgesOfSeam(edge));
  }

  /** Return of some seam edges the one nearest to their mean place on the model. */
  middleOf(edges) {
    const places = edges.map((index) => middleOf(this.shapeOf({kind: "seam", index}, false)[0]));
    const mean = middleOf(places), off = places.map((place) => Math.hypot(...place.map((x, k) => x - mean[k])));
    return edges[off.reduce((best, distance, i) => (distance < off[best] ? i : best), 0)];
  }

  /** Return the index of a vertex, or of a triangle, in the mesh of the user. */
  vertexNumber(vertex) {
    return this.arrays.vertex_numbers ? this.arrays.vertex_numbers[vertex] : vertex;
  }

  triangleNumber(triangle) {
    return this.arrays.face_numbers ? this.arrays.face_numbers[triangle] : triangle;
  }

  /** Return whether a colour map has a value for each triangle, not for each vertex. */
  isByFace(show) {
    return show === "qc" || show === "area" || show === "strain" || (show === "own" && this.head.own === "faces");
  }

  /** Return the positions of the values of a colour map on its scale, for each triangle or each vertex. */
  tones(show) {
    return placesOnScale(this.head.scales[show], this.arrays[show]);
  }

  /** Return whether a triangle hides a point seen from a direction, and is nearer than it by at least a distance. */
  isHidden(place, from, beyond) {
    const {places, faces, point_vertex} = this.arrays;
    for (let corner = 0; corner < faces.length; corner += 3) {
      const p = 3 * point_vertex[faces[corner]], q = 3 * point_vertex[faces[corner + 1]], r = 3 * point_vertex[faces[corner + 2]];
      const at = (v, k) => places[v + k] - place[k];
      // The ray intersects the triangle if its signed volumes with the three sides have equal signs.
      const volume = (a, b) =>
        from[0] * (at(a, 1) * at(b, 2) - at(a, 2) * at(b, 1)) +
        from[1] * (at(a, 2) * at(b, 0) - at(a, 0) * at(b, 2)) +
        from[2] * (at(a, 0) * at(b, 1) - at(a, 1) * at(b, 0));
      const one = volume(q, r), two = volume(r, p), three = volume(p, q), sum = one + two + three;
      if (!sum || Math.min(one * sum, two * sum, three * sum) < 0) continue;
      const depth = (v) => at(v, 0) * from[0] + at(v, 1) * from[1] + at(v, 2) * from[2];
      if ((one * depth(p) + two * depth(q) + three * depth(r)) / sum > beyond) return true;
    }
    return false;
  }

  /** Return the worst fault of the UVs of a triangle: 1 for the first of `fault_bits`, 2 for the second, …; 0 for none. */
  faultRank(triangle) {
    const bits = this.arrays.faults[triangle];
    return bits && Object.values(this.head.fault_bits).findIndex((bit) => bits & bit) + 1;
  }

  /** Return the names of the faults of a triangle. */
  faultsOf(triangle) {
    return Object.entries(this.head.fault_bits).filter(([, bit]) => this.arrays.faults[triangle] & bit).map(([name]) => name);
  }

  /** Return the number of places with a fault. */
  get faultCount() {
    return this.arrays.fault_places.length / 2;
  }

  /** Return the triangle with the largest finite QC distortion. */
  worstTriangle() {
    const qc = this.arrays.qc;
    let worst = 0;
    for (let i = 1; i < qc.length; i++) if (qc[i] > qc[worst] || !(qc[worst] >= 0)) worst = i;
    return worst;
  }

  /** Return whether another model has the same triangles in space, in the same order. */
  hasSurfaceOf(other) {
    const mine = this.arrays, its = other.arrays;
    if (mine.faces.length !== its.faces.length || mine.places.length !== its.places.length) return false;
    const areSame = mine.places === its.places;
    for (let i = 0; i < mine.places.length && !areSame; i++) if (mine.places[i] !== its.places[i]) return false;
    for (let c = 0; c < mine.faces.length; c++) {
      if (mine.point_vertex[mine.faces[c]] !== its.point_vertex[its.faces[c]]) return false;
    }
    return true;
  }

  findConePoints() {
    const cone = new Map(Array.from(this.arrays.cones, (vertex, index) => [vertex, index]));
    const found = Array.from(this.arrays.cones, () => []);
    if (!cone.size) return found;
    const vertices = this.arrays.point_vertex;
    for (let point = 0; point < vertices.length; point++) {
      const index = cone.get(vertices[point]);
      if (index !== undefined) found[index].push(point);
    }
    return found;
  }
}

/** Return the positions of values on a scale, from 0 to 1; -1 for undefined values. */
function placesOnScale(scale, values) {
  const {kind, low, high} = scale;
  const range = Math.log(high / low);
  const place = new Float32Array(values.length);
  for (let i = 0; i < values.length; i++) {
    const value = values[i];
    let at = (value - low) / (high - low);
    if (kind === "log") at = Math.log(Math.max(value, 1e-300) / low) / range;
    if (kind === "signed log") {
      at = 0.5 + (0.5 * Math.sign(value) * Math.log(Math.max(Math.abs(value), low) / low)) / range;
    }
    place[i] = Number.isNaN(value) ? -1 : Math.min(Math.max(at, 0), 1);
  }
  return place;
}
