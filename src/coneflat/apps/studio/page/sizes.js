// Sizes of the model, in the unit chosen by the user.

// [key, name, length in metres]
const UNITS = [
  ["", "no unit", 1],
  ["mm", "mm", 0.001],
  ["cm", "cm", 0.01],
  ["m", "m", 1],
  ["inch", "inches", 0.0254],
];

/** Return the text of a length, or an area (power 2), in the unit to be shown. */
function sizeText(value, power, [ofFile, shown]) {
  const metres = (unit) => UNITS.find(([key]) => key === unit)[2];
  const scaled = value * (shown ? metres(ofFile) / metres(shown) : 1) ** power;
  const unit = {inch: "in"}[shown || ofFile] ?? (shown || ofFile);
  const number = scaled !== 0 && (scaled < 1e-3 || scaled >= 1e7) ? scaled.toExponential(3) : Number(scaled.toPrecision(5)).toLocaleString("en-US", {maximumFractionDigits: 8});
  return unit ? `${number} ${unit}${power === 2 ? "²" : ""}` : number;
}

function showSizes(studio) {
  const {viewer, choices} = studio, part = (id) => document.getElementById(id), units = choices.units ?? ["", ""];
  part("unit").value = units[0];
  part("shown-in").value = units[1] === units[0] ? "" : units[1];
  part("shown-in").closest("label").hidden = !units[0];
  const head = viewer?.model.head;
  if (!head) return;
  const rows = [["Area", "area", 2], ["Seams", "seams", 1], ["Boundary", "boundary", 1]];
  part("size-list").replaceChildren(
    ...rows.flatMap(([name, key, power]) => [
      Object.assign(document.createElement("dt"), {textContent: name}),
      Object.assign(document.createElement("dd"), {textContent: sizeText(head.sizes[key] * head.radius ** power, power, units)}),
    ]),
  );
}
