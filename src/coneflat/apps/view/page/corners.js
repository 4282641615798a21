// Arrays with an entry for each corner of each triangle, for the graphics card.

function cornerPlaces(model) {
  const {places, point_vertex, faces} = model.arrays;
  const out = new Float32Array(3 * faces.length);
  for (let c = 0; c < faces.length; c++) {
    const v = 3 * point_vertex[faces[c]];
    out[3 * c] = places[v];
    out[3 * c + 1] = places[v + 1];
    out[3 * c + 2] = places[v + 2];
  }
  return out;
}

function cornerUVs(model) {
  const {uv, faces} = model.arrays;
  const out = new Float32Array(2 * faces.length);
  for (let c = 0; c < faces.length; c++) {
    out[2 * c] = uv[2 * faces[c]];
    out[2 * c + 1] = uv[2 * faces[c] + 1];
  }
  return out;
}

/** Return (m, 3) face normals with lengths of twice the areas. */
function faceNormals(places) {
  const out = new Float32Array(places.length / 3);
  for (let p = 0, f = 0; p < places.length; p += 9, f += 3) {
    const ax = places[p + 3] - places[p], ay = places[p + 4] - places[p + 1], az = places[p + 5] - places[p + 2];
    const bx = places[p + 6] - places[p], by = places[p + 7] - places[p + 1], bz = places[p + 8] - places[p + 2];
    out[f] = ay * bz - az * by;
    out[f + 1] = az * bx - ax * bz;
    out[f + 2] = ax * by - ay * bx;
  }
  return out;
}

/** Return the corners at each vertex: those of vertex v are list[start[v]] to list[start[v + 1] - 1]. */
function cornersAtVertices(model) {
  const {point_vertex, faces, places} = model.arrays;
  const start = new Uint32Array(places.length / 3 + 1);
  for (let c = 0; c < faces.length; c++) start[point_vertex[faces[c]] + 1]++;
  for (let v = 1; v < start.length; v++) start[v] += start[v - 1];
  const next = start.slice(), list = new Uint32Array(faces.length);
  for (let c = 0; c < faces.length; c++) list[next[point_vertex[faces[c]]]++] = c;
  return {start, list};
}

/** Return packed unit normals (10 bits per coordinate): the mean of the faces at the corner that are not separated by a crease. */
function cornerNormals(model, places) {
  const {point_vertex, faces} = model.arrays;
  const normals = faceNormals(places), crease = model.head.crease_cosine;
  const {start, list} = cornersAtVertices(model);
  const lengths = new Float32Array(faces.length / 3);
  for (let f = 0; f < lengths.length; f++) lengths[f] = Math.hypot(normals[3 * f], normals[3 * f + 1], normals[3 * f + 2]);
  const out = new Uint32Array(faces.length);
  for (let c = 0; c < faces.length; c++) {
    const own = (c / 3) | 0, v = point_vertex[faces[c]];
    const x = normals[3 * own], y = normals[3 * own + 1], z = normals[3 * own + 2];
    let sx = 0, sy = 0, sz = 0;
    for (let k = start[v]; k < start[v + 1]; k++) {
      const f = (list[k] / 3) | 0;
      const a = normals[3 * f], b = normals[3 * f + 1], d = normals[3 * f + 2];
      if (x * a + y * b + z * d < crease * lengths[own] * lengths[f]) continue;
      sx += a;
      sy += b;
      sz += d;
    }
    const unit = 511 / (Math.sqrt(sx * sx + sy * sy + sz * sz) || 1);
    out[c] = (Math.round(sx * unit) & 1023) | ((Math.round(sy * unit) & 1023) << 10) | ((Math.round(sz * unit) & 1023) << 20);
  }
  return out;
}

/** Return the position of each corner in the colour table for a display mode. */
function cornerValues(model, show) {
  const {faces, point_vertex, chart} = model.arrays;
  const out = new Float32Array(faces.length);
  if (show === "charts") {
    const tints = model.arrays.tints.length / 3;
    for (let c = 0; c < out.length; c++) out[c] = ((chart[(c / 3) | 0] % tints) + 0.5) / tints;
  } else if (show === "faults") {
    for (let c = 0; c < out.length; c++) out[c] = (model.faultRank((c / 3) | 0) + 0.5) / FAULT_COLOURS.length;
  } else if (model.head.scales[show]) {
    const tones = model.tones(show), byFace = model.isByFace(show);
    for (let c = 0; c < out.length; c++) out[c] = tones[byFace ? (c / 3) | 0 : point_vertex[faces[c]]];
    if (!byFace) fillUndefined(out);
  }
  return out;
}

/** Set undefined tones of corners to the mean of the other corners of the triangle, if defined. */
function fillUndefined(tones) {
  for (let c = 0; c < tones.length; c += 3) {
    if (Math.min(tones[c], tones[c + 1], tones[c + 2]) >= 0) continue;
    const three = tones.subarray(c, c + 3), known = three.filter((tone) => tone >= 0);
    const mean = known.length ? known.reduce((sum, tone) => sum + tone, 0) / known.length : -1;
    for (let k = 0; k < 3; k++) if (three[k] < 0) three[k] = mean;
  }
}

const QUAD = 6; // Vertices of the two triangles of a line or a dot.

/** Return the rows of an array, of a given length, repeated for every vertex of a quad. */
function forQuads(rows, size) {
  const out = new Float32Array(QUAD * rows.length);
  for (let i = 0; i < rows.length; i += size) {
    for (let k = 0; k < QUAD; k++) out.set(rows.slice(i, i + size), QUAD * i + size * k);
  }
  return out;
}

/** Return the ends of lines: seam edges, then boundary edges; in the layout a seam has two consecutive lines. */
function outlineLines(model, inPlane) {
  const begins = [], ends = [];
  for (let i = 0; i < model.arrays.outline.length; i++) {
    if (!inPlane && i < 2 * model.seamCount && i % 2) continue;
    const [begin, end] = model.outlineCorners(i).map((corner) => {
      const point = model.arrays.faces[corner];
      return inPlane ? model.flatPlace(point) : model.place(model.arrays.point_vertex[point]);
    });
    begins.push(...begin);
    ends.push(...end);
  }
  return [begins, ends];
}

/** Return the ends of the folds of pieces that are mountains, or of those that are valleys; none without pieces. */
function foldLines(model, inPlane, areMountains) {
  const begins = [], ends = [], {fold_places, fold_uv} = model.arrays, {folds, mountains} = model.head.parts ?? {folds: 0, mountains: 0};
  const at = (end) => (inPlane ? model.planePlace(fold_uv[2 * end], fold_uv[2 * end + 1]) : fold_places.subarray(3 * end, 3 * end + 3));
  for (let fold = areMountains ? 0 : mountains; fold < (areMountains ? mountains : folds); fold++) {
    begins.push(...at(2 * fold));
    ends.push(...at(2 * fold + 1));
  }
  return [begins, ends];
}

/** Return the positions of dots, and for each its radius in pixels, the sign of the curvature, and the index of the cone. */
function coneDots(model, inPlane) {
  const places = [], looks = [];
  for (let index = 0; index < model.coneCount; index++) {
    const curvature = model.head.cone_curvatures[index];
    const radius = Math.min(Math.max(6.5 * Math.sqrt(Math.abs(curvature) / (Math.PI / 2)), 3.5), 10) * (inPlane ? 0.75 : 1);
    for (const [at] of model.shapeOf({kind: "cone", index}, inPlane)) {
      places.push(...at);
      looks.push(radius, Math.sign(curvature), index);
    }
  }
  return [places, looks];
}
