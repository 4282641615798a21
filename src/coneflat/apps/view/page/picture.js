// Images for the model: one given by the user, or a board of numbered squares.

const MAX_PIXELS = 4096; // Pixels along a side that every graphics card supports.
const BOARD_SIZE = 1024, BOARD_SQUARES = 8;

/** Return a canvas of squares A1 to H8, A1 at the lower left, where u and v are 0; each row has its own hue. */
function numberedBoard() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = BOARD_SIZE;
  const pen = canvas.getContext("2d"), side = BOARD_SIZE / BOARD_SQUARES;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.font = `600 ${Math.round(0.42 * side)}px system-ui, sans-serif`;
  for (let row = 0; row < BOARD_SQUARES; row++) {
    for (let column = 0; column < BOARD_SQUARES; column++) {
      const x = column * side, y = BOARD_SIZE - (row + 1) * side;
      const light = (row + column) % 2 ? 88 : 74;
      pen.fillStyle = `hsl(${(360 * row) / BOARD_SQUARES} 55% ${light}%)`;
      pen.fillRect(x, y, side, side);
      pen.fillStyle = "#20262c";
      pen.fillText("ABCDEFGH"[column] + (row + 1), x + side / 2, y + side / 2);
    }
  }
  return canvas;
}

/** Return an image that the graphics card supports, reduced if necessary. */
async function pictureOf(blob) {
  let picture;
  try {
    picture = await createImageBitmap(blob);
  } catch {
    throw new Error("this browser cannot show the picture");
  }
  const share = Math.min(1, MAX_PIXELS / Math.max(picture.width, picture.height));
  if (share === 1) return picture;
  const size = {resizeWidth: Math.floor(picture.width * share), resizeHeight: Math.floor(picture.height * share)};
  return createImageBitmap(picture, {...size, resizeQuality: "high"});
}
