// The full mesh, also if the page draws fewer triangles: brushes and paths use its edges.

class Surface {
  /** Vertices are those of the page if it draws all triangles; otherwise they differ, but also have numbers of the user. */
  constructor(model) {
    const {places, faces, point_vertex, vertex_numbers, whole_places, whole_faces, whole_numbers} = model.arrays;
    this.key = Surface.keyOf(model);
    this.isThinned = Boolean(whole_faces);
    this.places = whole_places ?? places;
    this.corners = whole_faces ?? faces.map((point) => point_vertex[point]); // The vertex of each corner of each triangle.
    this.numbers = this.isThinned ? whole_numbers : vertex_numbers;
    this.count = this.places.length / 3;
  }

  /** Return the object that models of the same surface share. */
  static keyOf(model) {
    return model.arrays.whole_faces ?? model;
  }

  /** Return the number of a vertex in the mesh of the user; -1 for added vertices. */
  numberOf(vertex) {
    return this.numbers ? this.numbers[vertex] : vertex;
  }

  /** Return the vertex of a number of the user. */
  vertexOf(number) {
    if (!this.numbers) return number;
    if (!this.byNumber) {
      this.byNumber = new Int32Array(this.numbers.reduce((most, one) => Math.max(most, one), 0) + 1).fill(-1);
      for (let v = this.count - 1; v >= 0; v--) if (this.numbers[v] >= 0) this.byNumber[this.numbers[v]] = v;
    }
    return this.byNumber[number] ?? -1;
  }

  /** Return normals of triangles with lengths of twice the areas. */
  normals() {
    const {places, corners} = this, at = new Float32Array(3 * corners.length);
    for (let c = 0; c < corners.length; c++) for (let k = 0; k < 3; k++) at[3 * c + k] = places[3 * corners[c] + k];
    return faceNormals(at);
  }

  /** Return for each vertex the nearest of the given vertices by number of edges; -1 if none can be reached. */
  nearest(some, graph) {
    const nearest = new Int32Array(this.count).fill(-1), waiting = new Int32Array(this.count);
    let last = 0;
    const note = (vertex, one) => {
      if (nearest[vertex] >= 0) return;
      nearest[vertex] = one;
      waiting[last++] = vertex;
    };
    for (const vertex of some) note(vertex, vertex);
    for (let at = 0; at < last; at++) {
      const vertex = waiting[at];
      for (let k = graph.start[vertex]; k < graph.start[vertex + 1]; k++) note(graph.ends[k], nearest[vertex]);
    }
    return nearest;
  }
}
