// Texts on a triangle, a seam edge or a cone.

const SIGNS = ["−", "", "+"];

// Faults of UVs, and their colours; the first one is that of triangles without a fault.
const FAULT_NAMES = {flipped: "flipped", overlapping: "overlapping", outside: "outside the unit square"};
const FAULT_COLOURS = ["#dde2e9", "#7a35b8", "#d62222", "#e8a200"];

/** Return the text of a number with its sign: "+0.500", "−1.2e-4". */
function signed(value, digits = 3) {
  if (!Number.isFinite(value)) return "undefined";
  const amount = Math.abs(value);
  const text = amount !== 0 && (amount < 1e-3 || amount >= 1e4) ? amount.toExponential(1) : amount.toFixed(digits);
  return SIGNS[Math.sign(value) + 1] + text;
}

function grouped(number) {
  return number.toLocaleString("en-US");
}

function measured(value, prefix = "", digits = 4) {
  if (!Number.isFinite(value)) return "undefined";
  return prefix + (value >= 1e4 ? value.toExponential(2) : value.toFixed(digits));
}

/** Return texts on a thing; the first is its name. */
function factsOf(model, thing, show) {
  if (thing.kind === "triangle") return triangleFacts(model, thing.index, show);
  return thing.kind === "seam" ? seamFacts(model, thing.index) : coneFacts(model, thing.index);
}

function triangleFacts(model, index, show) {
  const {qc, area, strain, chart, faces, point_vertex} = model.arrays;
  const vertices = [0, 1, 2].map((k) => point_vertex[faces[3 * index + k]]);
  const facts = [`Triangle ${grouped(model.triangleNumber(index))}`];
  if (show === "own") {
    const values = model.isByFace("own") ? [model.arrays.own[index]] : vertices.map((v) => model.arrays.own[v]);
    facts.push(`${model.head.scales.own.title} ${values.map((value) => (Number.isFinite(value) ? Number(value.toPrecision(5)) : "undefined")).join(", ")}`);
  } else if (show === "curvature" || show === "flat") {
    const values = model.arrays[show];
    facts.push(`curvature at its corners ${vertices.map((v) => signed(values[v])).join(", ")}, in π`);
  } else if (show === "strain") {
    facts.push(`largest change of the length of a side ${Number.isFinite(strain[index]) ? `${signed(100 * strain[index], 2)}%` : "undefined"}`);
  } else if (show === "faults") {
    facts.push(model.faultsOf(index).map((name) => FAULT_NAMES[name]).join(", ") || "no fault");
  } else {
    facts.push(`QC ${measured(qc[index])}`, `scale ${measured(area[index], "×", 3)}`);
  }
  facts.push(`${partName(model)} ${chart[index] + 1}`, `vertices ${vertices.map((v) => grouped(model.vertexNumber(v))).join(", ")}`);
  return facts;
}

/** Return what charts are called. */
function partName(model) {
  return model.head.parts ? "piece" : "chart";
}

function seamFacts(model, index) {
  const lengths = model.shapeOf({kind: "seam", index}, true).map(([p, q]) => Math.hypot(p[0] - q[0], p[1] - q[1]));
  const ends = model.outlineCorners(2 * index).map((corner) => grouped(model.vertexNumber(model.vertexAt(corner))));
  const off = Math.abs(lengths[0] - lengths[1]) / Math.max((lengths[0] + lengths[1]) / 2, 1e-30);
  const charts = [0, 1].map((side) => model.arrays.chart[Math.floor(model.arrays.outline[2 * index + side] / 3)] + 1);
  const part = partName(model);
  const between = charts[0] === charts[1] ? `within ${part} ${charts[0]}` : `between ${part}s ${charts[0]} and ${charts[1]}`;
  // The page has single precision, about seven digits.
  const equal = off < 1e-4 ? "both sides of equal length" : `lengths of the sides differ by ${(100 * off).toPrecision(2)}%`;
  const parts = model.head.parts, isDivided = parts && model.namedEdges(index).length > 1;
  if (parts) return [parts.seam_texts[model.arrays.seam_numbers[index]], ...(isDivided ? [`here ${model.nameAt(index)}`] : []), between, `edge ${ends.join("–")}`];
  const count = model.edgesOfSeam(index).length;
  return [`Seam edge ${ends.join("–")}`, count === 1 ? "a seam of one edge" : `a seam of ${grouped(count)} edges`, between, equal];
}

function coneFacts(model, index) {
  const curvature = (180 / Math.PI) * model.head.cone_curvatures[index];
  const points = model.conePoints[index].length;
  if (model.head.parts) return [`Tip of a dart at vertex ${grouped(model.vertexNumber(model.arrays.cones[index]))}`, `opens by ${curvature.toFixed(1)}°`];
  return [
    `Cone at vertex ${grouped(model.vertexNumber(model.arrays.cones[index]))}`,
    `curvature ${signed(curvature, 1)}°`,
    `cone angle ${(360 - curvature).toFixed(1)}°`,
    points === 1 ? "one point of the layout" : `${points} points of the layout`,
  ];
}

/** Return the position of a triangle on the current colour scale, from 0 to 1, or null. */
function placeOfThing(model, thing, show) {
  const scale = model.head.scales[show];
  if (!scale || !thing || thing.kind !== "triangle") return null;
  const values = model.arrays[show];
  const corners = [0, 1, 2].map((k) => model.vertexAt(3 * thing.index + k));
  const chosen = model.isByFace(show) ? [values[thing.index]] : corners.map((v) => values[v]);
  const places = placesOnScale(scale, chosen).filter((place) => place >= 0);
  return places.length ? places.reduce((sum, place) => sum + place, 0) / places.length : null;
}
