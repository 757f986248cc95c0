// The route graph of a map: its edges as lines, with an arrow where one leads in one direction only, its nodes as dots.
import { find, setText } from "../show.js";
import { layersOf } from "./map-layers.js";

/** @typedef {{ version: string, note: string }} Routes */
/** @typedef {{ nodes: number[], edges: number[] }} Graph x, y … in centimetres; from, to … as numbers of nodes */

const ARROW_CM = 25;
const MOST_OF_EDGE = 0.3; // that an arrow takes of a short edge

/** @type {WeakMap<HTMLElement, string>} */
const shown = new WeakMap();

/** @param {HTMLElement} root @param {import("./map.js").MapView} view @param {Routes} routes */
export async function showRoutes(root, view, { version, note }) {
  if (!shown.has(root)) view.onDraw(() => place(root, view));
  const before = shown.get(root);
  shown.set(root, version);
  const row = find(root, "button[data-fixed='routes']");
  setText(row.querySelector("small"), note);
  layersOf(root, view).warn(row, note);
  if (version === before) return;
  draw(root, { nodes: [], edges: [] });
  if (!version) return;
  const response = await fetch(`${pageGuard.page.base}/widgets/${root.dataset.widget}/map/routes/${version}.json`);
  if (shown.get(root) !== version) return;
  if (response.ok) draw(root, await response.json());
  else shown.set(root, ""); // it is asked for again with the next map
}

/** @param {HTMLElement} root @param {Graph} graph */
function draw(root, { nodes, edges }) {
  const known = new Set();
  for (let at = 0; at < edges.length; at += 2) known.add(`${edges[at]} ${edges[at + 1]}`);
  const lines = [];
  for (let at = 0; at < edges.length; at += 2) {
    const [from, to] = [edges[at], edges[at + 1]];
    const isTwoWay = known.has(`${to} ${from}`);
    if (isTwoWay && from > to) continue;
    const [x, y, endX, endY] = [nodes[2 * from], nodes[2 * from + 1], nodes[2 * to], nodes[2 * to + 1]];
    lines.push(`M${x} ${y}L${endX} ${endY}`);
    if (!isTwoWay) lines.push(arrow(x, y, endX - x, endY - y));
  }
  const dots = [];
  for (let at = 0; at < nodes.length; at += 2) dots.push(`M${nodes[at]} ${nodes[at + 1]}h.01`);
  const [edgesPath, nodesPath] = find(root, ".map-routes").children;
  edgesPath.setAttribute("d", lines.join(""));
  nodesPath.setAttribute("d", dots.join(""));
}

// In the middle of an edge.
/** @param {number} x @param {number} y @param {number} dx @param {number} dy */
function arrow(x, y, dx, dy) {
  const length = Math.hypot(dx, dy);
  if (!length) return "";
  const size = Math.min(ARROW_CM, MOST_OF_EDGE * length);
  const [ahead, aside] = [(dx * size) / length, (dy * size) / length];
  const [tipX, tipY] = [x + (dx + ahead) / 2, y + (dy + aside) / 2];
  const wings = [-1, 1].map((side) => `${tipX - ahead - side * aside * 0.6} ${tipY - aside + side * ahead * 0.6}`);
  return `M${wings[0]}L${tipX} ${tipY}L${wings[1]}`;
}

/** @param {HTMLElement} root @param {import("./map.js").MapView} view */
function place(root, view) {
  const origin = view.at(0, 0);
  const perCentimetre = (view.at(1, 0).x - origin.x) / 100;
  if (!Number.isFinite(perCentimetre)) return;
  const transform = `translate(${origin.x} ${origin.y}) scale(${perCentimetre} ${-perCentimetre})`;
  find(root, ".map-routes").setAttribute("transform", transform);
}
