// The route graph of a map on a canvas: its edges as lines, with an arrow where one leads in one direction only, its
// nodes as dots. It is drawn again only when the view has moved: a large graph takes some tens of milliseconds.
import { find, setText } from "../show.js";
import { clearedCanvas } from "./map-canvas.js";
import { layersOf } from "./map-layers.js";

/** @typedef {{ version: string, note: string }} Routes */
/** @typedef {{ nodes: number[], edges: number[] }} Graph x, y … in centimetres; from, to … as numbers of nodes */
/** @typedef {{ x: number, y: number }} Point */

const LINE_PX = 2;
const DOT_PX = 4; // radius
const ARROW_PX = 7;
const LEAST_PX = 24; // of an edge with an arrow
const MARGIN_PX = 20; // around the view, in which dots and arrows may be seen

/** @type {WeakMap<HTMLElement, RoutesView>} */
const known = new WeakMap();

/** @param {HTMLElement} root @param {import("./map.js").MapView} view @param {Routes} routes */
export function showRoutes(root, view, routes) {
  const shown = known.get(root) ?? new RoutesView(root, view);
  known.set(root, shown);
  shown.show(routes);
}

class RoutesView {
  /** @type {HTMLElement} */
  #root;
  /** @type {import("./map.js").MapView} */
  #view;
  /** @type {HTMLCanvasElement} */
  #canvas;
  #version = "";
  /** @type {Graph} */
  #graph = { nodes: [], edges: [] };
  /** @type {boolean[]} */
  #isOneWay = []; // by edge
  #drawn = ""; // what the canvas shows

  /** @param {HTMLElement} root @param {import("./map.js").MapView} view */
  constructor(root, view) {
    [this.#root, this.#view, this.#canvas] = [root, view, find(root, "canvas.map-routes")];
    view.onDraw(() => this.#draw());
    new MutationObserver(() => view.draw()).observe(this.#canvas, { attributeFilter: ["hidden"] });
  }

  /** @param {Routes} routes */
  async show({ version, note }) {
    const row = find(this.#root, "button[data-fixed='routes']");
    setText(row.querySelector("small"), note);
    layersOf(this.#root, this.#view).warn(row, note);
    if (version === this.#version) return;
    this.#version = version;
    this.#take({ nodes: [], edges: [] });
    if (!version) return;
    const path = `${pageGuard.page.base}/widgets/${this.#root.dataset.widget}/map/routes/${version}.json`;
    const response = await fetch(path);
    if (version !== this.#version) return;
    if (response.ok) this.#take(await response.json());
    else this.#version = ""; // it is asked for again with the next change
  }

  /** @param {Graph} graph */
  #take(graph) {
    this.#graph = graph;
    const { edges } = graph;
    const ways = new Set();
    for (let at = 0; at < edges.length; at += 2) ways.add(`${edges[at]} ${edges[at + 1]}`);
    this.#isOneWay = Array.from(
      { length: edges.length / 2 },
      (_, n) => !ways.has(`${edges[2 * n + 1]} ${edges[2 * n]}`),
    );
    this.#drawn = "";
    this.#canvas.dataset.edges = String(edges.length / 2);
    this.#view.draw();
  }

  #draw() {
    const canvas = this.#canvas;
    if (canvas.hidden) return;
    const { x, y } = this.#view.at(0, 0);
    const perCentimetre = (this.#view.at(1, 0).x - x) / 100;
    const { clientWidth: width, clientHeight: height } = canvas;
    const key = [x, y, perCentimetre, width, height, document.documentElement.dataset.theme].join(" ");
    if (key === this.#drawn || !Number.isFinite(perCentimetre)) return;
    const context = clearedCanvas(canvas);
    if (!context) return;
    this.#drawn = key;
    const { nodes, edges } = this.#graph;
    const points = Array.from({ length: nodes.length / 2 }, (_, n) => ({
      x: x + perCentimetre * nodes[2 * n],
      y: y - perCentimetre * nodes[2 * n + 1],
    }));
    context.lineWidth = LINE_PX;
    this.#isOneWay.forEach((isOneWay, n) => {
      const [from, to] = [points[edges[2 * n]], points[edges[2 * n + 1]]];
      if ((isOneWay || edges[2 * n] < edges[2 * n + 1]) && isSeen(from, to, width, height))
        drawEdge(context, from, to, isOneWay);
    });
    for (const point of points) {
      if (!isSeen(point, point, width, height)) continue;
      context.beginPath();
      context.arc(point.x, point.y, DOT_PX, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

/** @param {Point} from @param {Point} to @param {number} width @param {number} height */
const isSeen = (from, to, width, height) =>
  Math.max(from.x, to.x) > -MARGIN_PX &&
  Math.max(from.y, to.y) > -MARGIN_PX &&
  Math.min(from.x, to.x) < width + MARGIN_PX &&
  Math.min(from.y, to.y) < height + MARGIN_PX;

// Each by itself: one path of all of them takes a hundred times as long.
/** @param {CanvasRenderingContext2D} context @param {Point} from @param {Point} to @param {boolean} isOneWay */
function drawEdge(context, from, to, isOneWay) {
  context.beginPath();
  context.moveTo(from.x, from.y);
  context.lineTo(to.x, to.y);
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const length = Math.hypot(dx, dy);
  if (isOneWay && length >= LEAST_PX) {
    const [ahead, aside] = [(dx * ARROW_PX) / length, (dy * ARROW_PX) / length];
    const [x, y] = [from.x + dx / 2 + ahead, from.y + dy / 2 + aside];
    context.moveTo(x - ahead - aside * 0.6, y - aside + ahead * 0.6);
    context.lineTo(x, y);
    context.lineTo(x - ahead + aside * 0.6, y - aside - ahead * 0.6);
  }
  context.stroke();
}
