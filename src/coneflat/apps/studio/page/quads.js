// Quads: computed on request, shown over both views, and saved from there.

const QUAD_FORMATS = ["obj", "ply", "glb"];

class Quads {
  constructor(studio) {
    this.studio = studio;
    this.part = (id) => document.getElementById(id);
    this.loaded = this.shown = 0; // Numbers of the quads whose page is loaded, and of those that are shown; 0 for none.
    this.asking = false;
    this.part("quad-files").append(
      ...QUAD_FORMATS.map((ending) => button(ending.toUpperCase(), `Save the quads as .${ending}`, () => this.save(ending), {id: `save-quads-${ending}`})),
    );
    this.part("make-quads").addEventListener("click", () => this.make());
    this.part("show-quads").addEventListener("click", () => this.toggle());
  }

  /** Compute quads, approximately the chosen number, and show them. */
  async make() {
    const {studio} = this, count = this.part("quad-count").value;
    studio.refused = null;
    this.asking = true;
    studio.panel.show();
    try {
      await studio.server.quads(count);
    } catch (error) {
      studio.refuse(error);
    }
    this.asking = false;
    studio.panel.show();
  }

  async save(ending) {
    await this.studio.server.save(`quads/${ending}`, `${this.studio.stem}_quads.${ending}`).catch((error) => this.studio.refuse(error));
  }

  /** Show new quads, and none of earlier settings. */
  async hear({quads}) {
    if (quads === this.loaded) return;
    this.loaded = this.shown = quads;
    this.show();
    if (!quads) {
      this.part("quads-view").srcdoc = ""; // Not before another page: of two navigations at a time, either may win.
      return;
    }
    const page = await this.studio.server.quadsPage().catch(orNone);
    if (!page || this.loaded !== quads) return;
    // Browsers complain of an element of a frame that asks for the focus.
    this.part("quads-view").srcdoc = page.replace(" autofocus", "");
    this.part("of-quads").scrollIntoView({block: "nearest"}); // What they can be used for.
  }

  toggle() {
    this.shown = this.shown ? 0 : this.loaded;
    this.show();
  }

  show() {
    const {studio} = this, isMaking = this.asking || studio.news?.making?.kind === "quads";
    document.body.classList.toggle("quads", this.shown > 0);
    this.part("quads-view").hidden = !this.shown;
    this.part("make-quads").disabled = !studio.hasLayout() || isMaking;
    this.part("make-quads").textContent = isMaking ? "Computing quads…" : "Compute quads";
    this.part("of-quads").hidden = !this.loaded;
    this.part("show-quads").textContent = this.shown ? "Back to the map" : "Show the quads";
  }
}
