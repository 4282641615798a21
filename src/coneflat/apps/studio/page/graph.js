// Shortest paths along the edges of a surface.

// As in `seams/costs.py`: dihedral angles in radians at which sharpness begins and is complete, and the factor of the cost of sharp edges.
const [SMOOTH, SHARP, CHEAPEST] = [Math.PI / 9, Math.PI / 3, 0.1];

class EdgeGraph {
  /** surface: {places, corners, count, numberOf(vertex), normals()}. */
  constructor(surface) {
    this.surface = surface;
    const {corners, count} = surface, start = new Uint32Array(count + 1);
    for (let c = 0; c < corners.length; c++) start[corners[c] + 1] += 2;
    for (let v = 0; v < count; v++) start[v + 1] += start[v];
    const next = start.slice(), ends = new Uint32Array(2 * corners.length), faces = new Uint32Array(2 * corners.length);
    // Inner edges have two entries, one from each of their triangles.
    const note = (one, two, face) => {
      faces[next[one]] = face;
      ends[next[one]++] = two;
    };
    for (let c = 0; c < corners.length; c++) {
      const face = Math.floor(c / 3), one = corners[c], two = corners[3 * face + ((c + 1) % 3)];
      note(one, two, face);
      note(two, one, face);
    }
    Object.assign(this, {start, ends, faces});
    this.from = -1;
    this.cut = new Set(); // The edges of drawn cuts, as keys.
    this.shares = null; // Sharpness of the edge of each entry, 0 to 1.
  }

  /** Set whether paths follow sharp edges, which then cost less than their lengths. */
  follow(sharp) {
    this.shares = sharp ? (this.found ??= sharpEdges(this)) : null;
    this.from = -1;
  }

  /** Set the drawn cuts. Their edges cost little, so that new paths join them: strips between two cuts would be slivers. */
  prefer(cuts) {
    if (cuts === this.cuts) return;
    this.cuts = cuts;
    this.from = -1;
    this.cut.clear();
    for (const path of cuts) {
      const vertices = path.map((number) => this.surface.vertexOf(number));
      for (let i = 1; i < vertices.length; i++) this.cut.add(this.edgeKey(vertices[i - 1], vertices[i]));
    }
  }

  edgeKey(one, two) {
    return Math.min(one, two) * this.surface.count + Math.max(one, two);
  }

  /** Return the cost of the edge of an entry of a vertex. */
  cost(vertex, k) {
    const length = this.length(vertex, this.ends[k]);
    if (this.cut.size && this.cut.has(this.edgeKey(vertex, this.ends[k]))) return length * CHEAPEST;
    return this.shares?.[k] ? length * CHEAPEST ** this.shares[k] : length;
  }

  length(one, two) {
    const p = this.surface.places;
    return Math.hypot(p[3 * one] - p[3 * two], p[3 * one + 1] - p[3 * two + 1], p[3 * one + 2] - p[3 * two + 2]);
  }

  /** Return the vertices of the shortest path between two vertices, both included; empty if there is none. */
  path(from, to) {
    if (from !== this.from) this.begin(from);
    this.reach(to);
    if (!this.isSettled[to]) return [];
    const path = [to];
    while (path[path.length - 1] !== from) path.push(this.before[path[path.length - 1]]);
    return path.reverse();
  }

  begin(from) {
    const {count} = this.surface;
    this.from = from;
    this.far = new Float64Array(count).fill(Infinity);
    this.before = new Int32Array(count).fill(-1);
    this.isSettled = new Uint8Array(count);
    this.far[from] = 0;
    this.heap = new Heap();
    this.heap.push(0, from);
  }

  /** Compute distances and predecessors from the starts of paths until a vertex is reached (Dijkstra). */
  reach(to) {
    const {heap, far, isSettled, surface} = this;
    while (heap.size && !isSettled[to]) {
      const [at, vertex] = heap.pop();
      if (isSettled[vertex]) continue;
      isSettled[vertex] = 1;
      for (let k = this.start[vertex]; k < this.start[vertex + 1]; k++) {
        const other = this.ends[k], sum = at + this.cost(vertex, k);
        // A vertex that was added by splitting triangles is not in the mesh of the user.
        if (sum >= far[other] || surface.numberOf(other) < 0) continue;
        far[other] = sum;
        this.before[other] = vertex;
        heap.push(sum, other);
      }
    }
  }
}

/** Return the sharpness of the edge of each entry of a graph, 0 to 1. */
function sharpEdges({surface, start, ends, faces}) {
  const normals = surface.normals(), shares = new Float32Array(ends.length);
  const dot = (a, b) => normals[3 * a] * normals[3 * b] + normals[3 * a + 1] * normals[3 * b + 1] + normals[3 * a + 2] * normals[3 * b + 2];
  for (let vertex = 0; vertex + 1 < start.length; vertex++) {
    for (let k = start[vertex]; k < start[vertex + 1]; k++) {
      let other = start[vertex];
      while (other < k && ends[other] !== ends[k]) other++;
      if (other === k) continue; // The first of its two sides, or the only one.
      const [a, b] = [faces[other], faces[k]];
      const cosine = dot(a, b) / (Math.sqrt(dot(a, a) * dot(b, b)) || 1);
      const share = (Math.acos(Math.min(Math.max(cosine, -1), 1)) - SMOOTH) / (SHARP - SMOOTH);
      if (share > 0) shares[k] = shares[other] = Math.min(share, 1);
    }
  }
  return shares;
}

/** A binary heap with the least key first. */
class Heap {
  constructor() {
    this.keys = [];
    this.values = [];
  }

  get size() {
    return this.keys.length;
  }

  push(key, value) {
    let at = this.keys.length;
    while (at > 0) {
      const above = (at - 1) >> 1;
      if (this.keys[above] <= key) break;
      this.place(at, this.keys[above], this.values[above]);
      at = above;
    }
    this.place(at, key, value);
  }

  pop() {
    const top = [this.keys[0], this.values[0]];
    const key = this.keys.pop(), value = this.values.pop(), size = this.keys.length;
    if (!size) return top;
    let at = 0;
    for (;;) {
      let below = 2 * at + 1;
      if (below >= size) break;
      if (below + 1 < size && this.keys[below + 1] < this.keys[below]) below++;
      if (this.keys[below] >= key) break;
      this.place(at, this.keys[below], this.values[below]);
      at = below;
    }
    this.place(at, key, value);
    return top;
  }

  place(at, key, value) {
    this.keys[at] = key;
    this.values[at] = value;
  }
}
