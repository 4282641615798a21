// Alignment of a layout with the one before it, so that a small change of the settings changes little in view.

const CHART_BASE = 2 ** 24;
const SAMPLED = 20_000; // Triangles that are compared.
const CLEARLY = 0.8; // Share of the squared distances that a turn must leave at most, so that the view is turned.

/** Return the rotation matrix of a number of quarter turns in the plane. */
function quarterTurns(count) {
  const [c, s] = [[1, 0], [0, 1], [-1, 0], [0, -1]][count];
  return [c, -s, 0, s, c, 0, 0, 0, 1];
}

/**
 * Return the parts that an earlier layout and a new one of the same triangles share, {now, old, area, moved}, the largest first.
 * A part has a chart of each; `moved` are its sums of squared distances for each number of quarter turns of the new layout.
 */
function sharedParts(before, turns, after) {
  const {faces, chart, uv} = after.arrays, parts = new Map();
  const middle = (model, face) => [0, 1].map((k) => [0, 1, 2].reduce((sum, i) => sum + model.flatPlace(model.arrays.faces[face + i])[k], 0) / 3);
  for (let i = 0, step = Math.max(1, Math.floor(chart.length / SAMPLED)); i < chart.length; i += step) {
    const key = chart[i] * CHART_BASE + before.arrays.chart[i], [p, q, r] = [0, 1, 2].map((k) => 2 * faces[3 * i + k]);
    if (!parts.has(key)) parts.set(key, {now: chart[i], old: before.arrays.chart[i], area: 0, moved: [0, 0, 0, 0]});
    const part = parts.get(key), area = Math.abs((uv[q] - uv[p]) * (uv[r + 1] - uv[p + 1]) - (uv[q + 1] - uv[p + 1]) * (uv[r] - uv[p]));
    const place = rotated(quarterTurns(turns), [...middle(before, 3 * i), 0]), other = [...middle(after, 3 * i), 0];
    part.area += area;
    for (let k = 0; k < 4; k++) {
      const [x, y] = rotated(quarterTurns(k), other);
      part.moved[k] += area * ((x - place[0]) ** 2 + (y - place[1]) ** 2);
    }
  }
  return [...parts.values()].sort((one, other) => other.area - one.area);
}

/** Return the pairs of a new chart and the earlier one with which it shares the largest area; each chart is in one pair at most. */
function chartPairs(parts) {
  const used = [new Set(), new Set()];
  return parts.filter(({now, old}) => {
    if (used[0].has(now) || used[1].has(old)) return false;
    used[0].add(now);
    used[1].add(old);
    return true;
  });
}

/** Return the number of quarter turns of a new layout with which its charts are nearest to the earlier ones of the pairs. */
function nearestTurns(pairs) {
  const sums = [0, 1, 2, 3].map((k) => pairs.reduce((sum, pair) => sum + pair.moved[k], 0)), least = Math.min(...sums);
  return least < CLEARLY * sums[0] ? sums.indexOf(least) : 0;
}

/** Renumber the charts of a layout so that each has the number, and so the colour, of the earlier chart of its pair. */
function keepChartNumbers(pairs, after) {
  const numbers = new Map(pairs.map(({now, old}) => [now, old])), taken = new Set(numbers.values());
  let free = 0;
  for (const chart of new Set(after.arrays.chart)) {
    if (numbers.has(chart)) continue;
    while (taken.has(free)) free++;
    numbers.set(chart, free);
    taken.add(free);
  }
  after.arrays.chart = after.arrays.chart.map((chart) => numbers.get(chart));
}
