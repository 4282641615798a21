// The curve of distortion by number of cones, with the current layout.

const INSETS = {left: 34, right: 8, top: 8, bottom: 20}; // pixels

class ConeCurve {
  constructor(studio) {
    this.studio = studio;
    this.part = (id) => document.getElementById(id);
    this.found = null; // {counts, distortions, knee, parts, key}
    this.waiting = false;
    this.part("curve-ask").addEventListener("click", () => this.ask());
    this.part("curve").addEventListener("click", (event) => this.pick(event));
    new ResizeObserver(() => this.draw()).observe(this.part("curve"));
  }

  /** Return a key of the choices on which the curve depends. */
  key() {
    const {choices, news} = this.studio, {paint = {}, options, cuts, kept} = choices;
    const locked = choices.cones.filter((cone) => cone.locked).map((cone) => cone.vertex);
    return JSON.stringify([news?.mesh, locked, paint, cuts, kept, options.seams, options.sharp_angle, options.repair]);
  }

  async ask() {
    const {studio} = this, key = this.key();
    if (this.waiting || !studio.viewer || studio.forTexture) return;
    studio.refused = null;
    this.waiting = true;
    studio.panel.show();
    try {
      this.found = {...(await studio.server.curve()), key};
    } catch (error) {
      studio.refuse(error);
    }
    this.waiting = false;
    studio.panel.show();
    this.part("curve-of").scrollIntoView({block: "nearest"}); // The curve above it, too.
  }

  show() {
    const isKnown = this.found?.key === this.key() && this.found.counts.length > 1;
    this.part("curve").hidden = !isKnown;
    this.part("curve-ask").hidden = isKnown;
    this.part("curve-ask").disabled = this.waiting || !this.studio.viewer;
    this.part("curve-ask").textContent = this.waiting ? "Comparing numbers of cones…" : "Compare numbers of cones";
    this.part("curve-of").hidden = !isKnown;
    if (!isKnown) return;
    const {parts} = this.found;
    this.part("curve-of").textContent = `Distortion of the mesh by number of cones${parts > 1 ? ` in each of its ${grouped(parts)} parts` : ""}. Click to choose a number.`;
    this.draw();
  }

  /** Return the position of a number of cones and a distortion, in pixels. */
  places() {
    const {width, height} = this.part("curve").getBoundingClientRect(), {counts, distortions} = this.found;
    const last = counts[counts.length - 1], first = counts[0], most = Math.max(...distortions) * 1.04;
    const across = width - INSETS.left - INSETS.right, down = height - INSETS.top - INSETS.bottom;
    return {
      width, height, most, first, last,
      x: (count) => INSETS.left + (across * (count - first)) / (last - first),
      y: (value) => INSETS.top + down * (1 - Math.min(value / most, 1)),
    };
  }

  draw() {
    const canvas = this.part("curve");
    if (canvas.hidden || !this.found) return;
    const {counts, distortions, knee} = this.found, at = this.places(), pixel = Math.min(devicePixelRatio || 1, 2);
    if (!at.width) return;
    sizeCanvas(canvas, at.width * pixel, at.height * pixel);
    const pen = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    pen.setTransform(pixel, 0, 0, pixel, 0, 0);
    pen.clearRect(0, 0, at.width, at.height);
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = colour("faint");
    pen.strokeStyle = colour("line");
    pen.lineWidth = 1;
    for (const value of ticksUpTo(at.most)) {
      pen.beginPath();
      pen.moveTo(INSETS.left, Math.round(at.y(value)) + 0.5);
      pen.lineTo(at.width - INSETS.right, Math.round(at.y(value)) + 0.5);
      pen.stroke();
      pen.textAlign = "right";
      pen.fillText(Number(value.toPrecision(3)), INSETS.left - 5, at.y(value) + 4);
    }
    pen.textAlign = "left";
    pen.fillText(at.first, at.x(at.first), at.height - 5);
    pen.textAlign = "right";
    pen.fillText(`${at.last} cones`, at.width - INSETS.right, at.height - 5);
    const line = new Path2D();
    counts.forEach((count, i) => (i ? line.lineTo(at.x(count), at.y(distortions[i])) : line.moveTo(at.x(count), at.y(distortions[i]))));
    pen.strokeStyle = colour("pressed");
    pen.lineWidth = 2;
    pen.stroke(line);
    this.dot(pen, at.x(knee), at.y(distortions[counts.indexOf(knee)]), 3.5, colour("pane"), colour("pressed"));
    const now = this.current();
    if (now) this.dot(pen, at.x(now[0]), at.y(now[1]), 4.5, colour("accent"), colour("accent"));
    const told = now ? `; now ${now[0]} with ${now[1].toPrecision(2)}` : "";
    const label = `Distortion from ${distortions[0].toPrecision(2)} with ${at.first} cones to ${distortions[distortions.length - 1].toPrecision(2)} with ${at.last}; most is gained up to ${knee}${told}`;
    canvas.setAttribute("aria-label", label);
    canvas.title = `${label}. Click to choose a number.`;
  }

  dot(pen, x, y, radius, fill, line) {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fillStyle = fill;
    pen.strokeStyle = line;
    pen.fill();
    pen.stroke();
  }

  /** Return the current number of cones and its distortion; null if it is not on the curve. */
  current() {
    if (this.studio.choices.by_hand) return null; // Cones that were moved have another distortion.
    const {counts, distortions, parts} = this.found, asked = this.studio.choices.options.cone_count;
    if (parts > 1 && asked === undefined) return null; // The numbers of the parts differ.
    const count = parts > 1 ? asked : this.studio.coneRows().length, at = counts.findLastIndex((one) => one <= count);
    return at < 0 || count > counts[counts.length - 1] ? null : [count, distortions[at]];
  }

  pick(event) {
    const at = this.places(), {counts} = this.found, x = event.clientX - this.part("curve").getBoundingClientRect().left;
    this.studio.setCount(leastOf(counts, (count) => Math.abs(at.x(count) - x)));
  }
}

/** Return three to five round numbers from 0 to a maximum. */
function ticksUpTo(most) {
  const rough = most / 4, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].find((factor) => factor * power >= rough) * power;
  return Array.from({length: Math.floor(most / step) + 1}, (_, k) => k * step);
}
