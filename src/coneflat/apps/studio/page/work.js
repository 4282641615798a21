// The computation that is running: its progress, about how long the rest takes, and a button that cancels it.

/** Outputs other than layouts that report progress. */
const MAKING = {quads: "quads", curve: "numbers of cones"};
// Seconds, and fraction of all work, after which the rest of the time is estimated, as in `apps/cli/run.py`.
const MIN_ELAPSED = 3, MIN_FRACTION = 0.05;

class Work {
  constructor(studio) {
    this.studio = studio;
    this.part = (id) => document.getElementById(id);
    this.begun = {key: "", at: 0}; // The computation that is running, and when it began.
    this.part("cancel").addEventListener("click", () => studio.server.cancel().catch((error) => studio.refuse(error)));
  }

  show() {
    const {news, took} = this.studio, busy = news?.busy ?? news?.making;
    this.part("cancel").hidden = !busy;
    this.part("work").classList.toggle("idle", !busy);
    this.part("busy").value = busy?.fraction ?? 0;
    this.part("stage-name").textContent = busy ? this.textOf(busy) : took ? `shown ${(took / 1000).toFixed(2)} s after the change` : "";
    if (!busy) this.begun.key = "";
  }

  textOf(busy) {
    const key = `${busy.kind ?? ""} ${busy.kind ? busy.job : this.studio.news.chosen}`;
    if (key !== this.begun.key) this.begun = {key, at: performance.now()};
    const left = timeLeft((performance.now() - this.begun.at) / 1000, busy.fraction);
    return [busy.kind ? `${MAKING[busy.kind]}: ` : "", stageText(busy.stage), left && ` (${left})`].join("");
  }
}

/** Return the text of a stage of the computation. */
function stageText(stage) {
  return stage.startsWith("atlas") ? "separating overlaps" : stage || "…";
}

/** Return about how long the rest of the work takes; "" while too little is done to tell. */
function timeLeft(elapsed, fraction) {
  if (elapsed < MIN_ELAPSED || fraction < MIN_FRACTION || fraction >= 1) return "";
  const seconds = elapsed * (1 / fraction - 1);
  return seconds >= 57 ? `about ${Math.max(Math.round(seconds / 60), 1)} min left` : `about ${Math.max(5 * Math.round(seconds / 5), 5)} s left`;
}
