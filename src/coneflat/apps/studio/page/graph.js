// Shortest paths along the edges of a surface.

// As in `seams/costs.py`: radians of bending from which on an edge is sharp at all, and fully; and what it costs then.
const [SMOOTH, SHARP, CHEAPEST] = [Math.PI / 9, Math.PI / 3, 0.1];

class EdgeGraph {
  constructor(model) {
    this.model = model;
    const count = model.arrays.places.length / 3, corners = model.arrays.faces.length;
    const start = new Uint32Array(count + 1);
    for (let c = 0; c < corners; c++) start[model.vertexAt(c) + 1] += 2;
    for (let v = 0; v < count; v++) start[v + 1] += start[v];
    const next = start.slice(), ends = new Uint32Array(2 * corners);
    // Inner edges are there twice, from both of their triangles, which does no harm.
    for (let c = 0; c < corners; c++) {
      const one = model.vertexAt(c), two = model.vertexAt(c - (c % 3) + ((c + 1) % 3));
      ends[next[one]++] = two;
      ends[next[two]++] = one;
    }
    [this.start, this.ends] = [start, ends];
    this.from = -1;
    this.sharpness = null;
  }

  /** Whether paths follow sharp edges, which then cost less than their lengths. */
  follow(sharp) {
    this.sharpness = sharp ? (this.found ??= sharpEdges(this.model)) : null;
    this.from = -1;
  }

  cost(one, two) {
    const share = this.sharpness?.get(one < two ? one * this.start.length + two : two * this.start.length + one) ?? 0;
    return this.length(one, two) * CHEAPEST ** share;
  }

  length(one, two) {
    const p = this.model.arrays.places;
    return Math.hypot(p[3 * one] - p[3 * two], p[3 * one + 1] - p[3 * two + 1], p[3 * one + 2] - p[3 * two + 2]);
  }

  /** The vertices of the shortest path from one to another, both included; empty where none leads there. */
  path(from, to) {
    if (from !== this.from) this.spread(from);
    if (!Number.isFinite(this.far[to])) return [];
    const path = [to];
    while (path[path.length - 1] !== from) path.push(this.before[path[path.length - 1]]);
    return path.reverse();
  }

  /** Find how far all vertices are from one, and by which way (Dijkstra). */
  spread(from) {
    const count = this.start.length - 1;
    this.from = from;
    this.far = new Float64Array(count).fill(Infinity);
    this.before = new Int32Array(count).fill(-1);
    this.far[from] = 0;
    const heap = new Heap();
    heap.push(0, from);
    while (heap.size) {
      const [far, vertex] = heap.pop();
      if (far > this.far[vertex]) continue;
      for (let k = this.start[vertex]; k < this.start[vertex + 1]; k++) {
        const other = this.ends[k], sum = far + this.cost(vertex, other);
        if (sum >= this.far[other]) continue;
        this.far[other] = sum;
        this.before[other] = vertex;
        heap.push(sum, other);
      }
    }
  }
}

/** How sharp edges are, 0 to 1, of those that are: by the smaller vertex times their number plus one, plus the other. */
function sharpEdges(model) {
  const {faces, places} = model.arrays, base = places.length / 3 + 1;
  const normals = faceNormals(cornerPlaces(model)), sides = new Map(), found = new Map();
  for (let c = 0; c < faces.length; c++) {
    const face = Math.floor(c / 3), one = model.vertexAt(c), two = model.vertexAt(3 * face + ((c + 1) % 3));
    const key = one < two ? one * base + two : two * base + one, other = sides.get(key);
    if (other === undefined) {
      sides.set(key, face);
      continue;
    }
    const [a, b] = [face, other].map((f) => normals.subarray(3 * f, 3 * f + 3));
    const cosine = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (Math.hypot(...a) * Math.hypot(...b) || 1);
    const share = (Math.acos(Math.min(Math.max(cosine, -1), 1)) - SMOOTH) / (SHARP - SMOOTH);
    if (share > 0) found.set(key, Math.min(share, 1));
  }
  return found;
}

/** A binary heap, the least key first. */
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
