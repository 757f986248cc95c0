// The zones of a map, under the robot: areas with their names. What may not be entered is hatched, a way has an arrow.
import { svgElement } from "../show.js";

/** @typedef {{ label: string, kind: string, rings: number[][][], yaw: number | null }} Zone */

const ARROW = "M-26 0H26m-14-12 14 12-14 12";

/** @type {WeakMap<HTMLElement, Zone[]>} */
const shown = new WeakMap();

/** @param {HTMLElement} root @param {import("./map.js").MapView} view @param {Zone[]} zones */
export function showZones(root, view, zones) {
  if (shown.get(root) === zones) return;
  const isFirst = !shown.has(root);
  shown.set(root, zones);
  const marks = root.querySelector("svg.map-marks");
  if (isFirst) {
    const hatch = `hatch-${root.dataset.widget}`;
    const pattern = svgElement("pattern", { id: hatch, width: "12", height: "12", patternUnits: "userSpaceOnUse" });
    pattern.setAttribute("patternTransform", "rotate(45)");
    pattern.append(svgElement("path", { d: "M6 0V12" }));
    marks?.prepend(pattern, svgElement("g", { class: "map-zones", fill: `url(#${hatch})` }));
    view.onDraw(() => draw(root, view));
  }
  root.querySelector(".map-zones")?.replaceChildren(
    ...zones.map(({ label, kind }) => {
      const zone = svgElement("g", { "data-zone": kind });
      const name = svgElement("text", { "text-anchor": "middle", dy: kind === "one_way" ? "-2em" : ".36em" });
      name.textContent = label;
      zone.append(svgElement("path", { class: "map-area" }), name);
      if (kind === "one_way") zone.append(svgElement("path", { d: ARROW }));
      return zone;
    }),
  );
  draw(root, view);
}

/** @param {{ x: number, y: number }[]} ring */
const outline = (ring) => `M${ring.map(({ x, y }) => `${x} ${y}`).join("L")}Z`;

/** @param {HTMLElement} root @param {import("./map.js").MapView} view */
function draw(root, view) {
  (shown.get(root) ?? []).forEach(({ rings, yaw }, number) => {
    const zone = root.querySelector(".map-zones")?.children[number];
    const [area, name, arrow] = zone?.children ?? [];
    zone?.toggleAttribute("hidden", !view.version);
    const [corners, ...holes] = rings.map((ring) => ring.map(([x, y]) => view.at(x, y)));
    area?.setAttribute("d", [corners, ...holes].map(outline).join(""));
    const [xs, ys] = [corners.map(({ x }) => x), corners.map(({ y }) => y)];
    const x = (Math.min(...xs) + Math.max(...xs)) / 2;
    const y = (Math.min(...ys) + Math.max(...ys)) / 2;
    name?.setAttribute("transform", `translate(${x} ${y})`);
    arrow?.setAttribute("transform", `translate(${x} ${y}) rotate(${(-(yaw ?? 0) * 180) / Math.PI})`);
  });
}
