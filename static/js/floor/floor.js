// The page as a machine's screen: cleaning, dimming, and none of a browser's own gestures.
import { find } from "../show.js";

const ZOOM_KEYS = ["+", "-", "=", "0"];
const coarse = matchMedia("(pointer: coarse)");

// Where a finger is the main pointer: a developer's browser keeps its own. The rest is in floor.css.
function isKiosk() {
  return "kiosk" in document.documentElement.dataset && coarse.matches;
}

/** @template {keyof WindowEventMap} K @param {K} name @param {(event: WindowEventMap[K]) => boolean} isGesture */
function refuse(name, isGesture = () => true) {
  /** @param {WindowEventMap[K]} event */
  const listener = (event) => isKiosk() && isGesture(event) && event.preventDefault();
  addEventListener(name, listener, { capture: true, passive: false });
}

refuse("contextmenu");
refuse("dragstart");
refuse("gesturestart"); // a pinch in WebKit
refuse("wheel", ({ ctrlKey }) => ctrlKey);
refuse("keydown", ({ key, ctrlKey, metaKey }) => (ctrlKey || metaKey) && ZOOM_KEYS.includes(key));

const afterMs = 1000 * (pageGuard.page.dimAfterS ?? 0);
if (afterMs) import("./dim.js").then(({ Dimming }) => new Dimming(afterMs)).catch(pageGuard.fail);

// Loaded with the menu, and where the page was loaded again while it was cleaned.
/** @type {Promise<import("./clean.js").Cleaning | void> | null} */
let cleaning = null;
const begin = () => import("./clean.js").then(({ Cleaning }) => new Cleaning()).catch(pageGuard.fail);
const loaded = () => (cleaning ??= begin());
if (pageGuard.recall("cleaning-until")) loaded();
const menu = find(document, "#menu");
menu.addEventListener("toggle", loaded, { once: true });
menu.addEventListener("beforetoggle", () => import("../header-in-menu.js").catch(pageGuard.fail), { once: true });
const key = find(document, ".menu .clean");
key.hidden = false;
key.addEventListener("click", () => loaded().then((one) => one?.start()));
document.documentElement.dataset.floor = ""; // all of this is in force
