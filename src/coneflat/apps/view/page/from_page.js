// Start of a page that contains its data.

/** Start the viewer with the data in the page. */
async function startFromPage() {
  try {
    if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old for the page");
    const head = JSON.parse(document.getElementById("head").textContent);
    const arrays = document.getElementById("arrays");
    const model = await unpackModel(head, arrays.textContent.trim());
    arrays.remove();
    const picture = head.picture ? await pictureOf(new Blob([model.arrays.picture], {type: head.picture})) : null;
    window.coneflat = new Viewer(model, picture);
    if (!head.parts) window.coneflat.showUnitSquare();
    document.documentElement.dataset.ready = String(Math.round(performance.now()));
  } catch (error) {
    trouble(error.message);
    throw error;
  }
}

startFromPage();
