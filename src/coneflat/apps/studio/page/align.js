// Alignment of a layout with the one before it, so that a small change of the settings changes little in view.

const CHART_BASE = 2 ** 24;
const SAMPLED = 4000; // Triangles that are compared.

/** Return the rotation matrix of a number of quarter turns in the plane. */
function quarterTurns(count) {
  const [c, s] = [[1, 0], [0, 1], [-1, 0], [0, -1]][count];
  return [c, -s, 0, s, c, 0, 0, 0, 1];
}

/** Return the number of quarter turns with which a layout clearly is nearest to an earlier one of the same triangles, rotated by its own. */
function nearestTurns(before, turns, after) {
  const {faces} = after.arrays, step = 3 * Math.max(1, Math.floor(faces.length / 3 / SAMPLED)), sums = [0, 0, 0, 0];
  for (let corner = 0; corner < faces.length; corner += step) {
    const place = rotated(quarterTurns(turns), before.flatPlace(before.arrays.faces[corner])), other = after.flatPlace(faces[corner]);
    for (let k = 0; k < 4; k++) {
      const [x, y] = rotated(quarterTurns(k), other);
      sums[k] += Math.hypot(x - place[0], y - place[1]);
    }
  }
  const least = Math.min(...sums);
  return least < sums[0] / 2 ? sums.indexOf(least) : 0;
}

/** Renumber the charts of a layout so that each has the number, and so the colour, of the earlier chart with which it shares most triangles. */
function keepChartNumbers(before, after) {
  const [old, now] = [before.arrays.chart, after.arrays.chart], shared = new Map();
  if (old === now) return;
  for (let i = 0; i < now.length; i++) {
    const key = now[i] * CHART_BASE + old[i];
    shared.set(key, (shared.get(key) ?? 0) + 1);
  }
  const numbers = new Map(), taken = new Set();
  for (const [key] of [...shared].sort((one, other) => other[1] - one[1])) {
    const [mine, its] = [Math.floor(key / CHART_BASE), key % CHART_BASE];
    if (numbers.has(mine) || taken.has(its)) continue;
    numbers.set(mine, its);
    taken.add(its);
  }
  let free = 0;
  for (const chart of new Set(now)) {
    if (numbers.has(chart)) continue;
    while (taken.has(free)) free++;
    numbers.set(chart, free);
    taken.add(free);
  }
  after.arrays.chart = now.map((chart) => numbers.get(chart));
}
