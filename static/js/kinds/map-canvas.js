// A canvas over a map, for what has too many parts for SVG.

// Its context, cleared, in CSS pixels and with the canvas's text colour.
/** @param {HTMLCanvasElement} canvas */
export function clearedCanvas(canvas) {
  const { clientWidth, clientHeight } = canvas;
  const [width, height] = [clientWidth * devicePixelRatio, clientHeight * devicePixelRatio].map(Math.round);
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  if (!context) return null;
  context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
  context.clearRect(0, 0, clientWidth, clientHeight);
  context.fillStyle = context.strokeStyle = getComputedStyle(canvas).color;
  return context;
}
