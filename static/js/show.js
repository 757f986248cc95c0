// What the page shows: attributes of widgets, receipts, reports, locks, and the texts of keys. In place, and it composes no
// sentence.
import { releaseEntry } from "./entries.js";

// The receipts of this page's presses: each looks old after some seconds, and goes; the operator's log keeps it. As
// the server does it with the results that all browsers show (app/cell/view/times.py).
const AGED_MS = 10_000;
const GOOD_MS = 60_000;
const BAD_MS = 600_000;
const GOOD = ["published", "confirmed", "accepted", "succeeded"];

/** @param {string} outcome */
export const isGood = (outcome) => GOOD.includes(outcome);

/** @type {WeakMap<HTMLElement, number>} */
const timers = new WeakMap();

// An empty outcome is none.
/** @param {HTMLElement} receipt @param {string} outcome @param {string | undefined} reason */
export function showOutcome(receipt, outcome, reason) {
  clearTimeout(timers.get(receipt));
  receipt.toggleAttribute("data-aged", false);
  receipt.textContent = reason ?? "";
  if (outcome) receipt.dataset.outcome = outcome;
  else delete receipt.dataset.outcome;
  if (reason) age(receipt, outcome);
}

/** @param {HTMLElement} receipt @param {string} outcome */
function age(receipt, outcome) {
  const left = (isGood(outcome) ? GOOD_MS : BAD_MS) - AGED_MS;
  const turnOld = () => {
    receipt.toggleAttribute("data-aged", true);
    timers.set(
      receipt,
      setTimeout(() => showOutcome(receipt, "", ""), left),
    );
  };
  timers.set(receipt, setTimeout(turnOld, AGED_MS));
}

// The one that the page came with.
for (const receipt of document.querySelectorAll(".receipt[data-outcome]"))
  if (receipt.textContent) age(receipt, receipt.dataset.outcome ?? "");

// The attributes of widgets: texts and element properties.

// What the scripts of widget kinds register, by the kind.
/** @type {Map<string | undefined, Hooks>} */
const registered = new Map();

/** @param {string} kind @param {Hooks} hooks */
export function addHooks(kind, hooks) {
  registered.set(kind, hooks);
}

/** @param {HTMLElement} root @returns {Hooks} */
export function hooksOf(root) {
  return registered.get(root.dataset.kind) ?? {};
}

// Whether the script of its kind is there, if there is one: nothing is pressed before that.
/** @param {HTMLElement} root */
export function isEquipped({ dataset: { kind = "" } }) {
  return registered.has(kind) || !(kind in pageGuard.page.kinds);
}

// Whether a person confirms its presses with a PIN.
/** @param {HTMLElement} root */
export const needsPerson = (root) => pageGuard.page.confirms.includes(root.dataset.widget ?? "");

// An element that the markup must have.
/** @template {string} S @param {ParentNode} root @param {S} selector @returns {PageElement<S>} */
export function find(root, selector) {
  const element = root.querySelector(selector);
  if (!element) throw new Error(selector);
  return element;
}

// The element that an event met, or one around it.
/** @template {string} S @param {EventTarget | null} target @param {S} selector @returns {PageElement<S> | null} */
export function closest(target, selector) {
  return target instanceof Element ? target.closest(selector) : null;
}

export const STOPS = '[data-role="stop"] > button[type="submit"]';

/** @param {EventTarget | null} target */
export function isStop(target) {
  return closest(target, STOPS) !== null;
}

/** @template {keyof SVGElementTagNameMap} K @param {K} tag @param {Record<string, string | number>} [attributes] @param {Element[]} children @returns {SVGElementTagNameMap[K]} */
export function svgElement(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.append(...children);
  return made;
}

/** @param {HTMLTemplateElement} template */
export function copyOf(template) {
  return find(document.importNode(template.content, true), "*");
}

/** @param {HTMLElement | null} element @param {string | undefined} text */
export function setText(element, text = "") {
  if (!element) return;
  if (element.dataset.unit) setValue(element, text);
  else setOnlyText(element, text);
}

// A number and, smaller, its unit; another text, such as that there is no value, has none.
/** @param {HTMLElement} element @param {string} text */
function setValue(element, text) {
  const [number, unit] = find(element, "span").children;
  const ending = ` ${element.dataset.unit}`;
  const hasUnit = text.endsWith(ending);
  setOnlyText(number, hasUnit ? text.slice(0, -ending.length) : text);
  setOnlyText(unit, hasUnit ? ending : "");
}

// A text node that is there stays: a new one would cost the page its style and layout as well.
/** @param {Element} element @param {string} text */
function setOnlyText(element, text) {
  const node = element.firstChild;
  if (node instanceof Text && !node.nextSibling) {
    if (node.data !== text) node.data = text;
  } else if (node || text) element.textContent = text;
}

// What is locked with a widget: its buttons. It can always be canceled, and a button of its kind's script (`data-own`) has a lock of its own. Looked for once:
// a permission that changes does not wait for it.
/** @type {WeakMap<HTMLElement, HTMLButtonElement[]>} */
const keys = new WeakMap();

/** @param {HTMLElement} root @returns {HTMLButtonElement[]} */
function keysOf(root) {
  const selector = "button[type=submit]:not(.cancel):not([data-own]), button.hold";
  const buttons = keys.get(root) ?? [...root.querySelectorAll(selector)];
  keys.set(root, buttons);
  return buttons;
}

/** @template T @param {T | null} element @param {Partial<T>} properties */
const assign = (element, properties) => element && Object.assign(element, properties);

// How an attribute is shown. One that is not here has a place in the markup: `data-text` for a text,
// `data-value` for the value of an element such as a meter, `data-width` for the width of a bar in percent, or an
// attribute of the widget's root.
/** @type {Record<string, Show>} */
const SHOW = {
  enabled: (root, value) => {
    for (const key of keysOf(root)) key.disabled = !value;
    hooksOf(root).lock?.(root, !value);
    if (!value) root.querySelector(".ask:popover-open")?.hidePopover();
  },
  stoppable: (root, value) => assign(root.querySelector("button.cancel"), { disabled: !value }),
  press: (root, value) => assign(root.querySelector("button.cancel"), { value }),
  held: (root, value) => root.toggleAttribute("data-held", value),
  outcome: (root, outcome) => assign(find(root, ".result").dataset, { outcome }),
  aged: (root, value) => find(root, ".result").toggleAttribute("data-aged", value),
  busy: (root, value) => {
    root.toggleAttribute("data-busy", value);
    assign(root.querySelector("progress"), { hidden: !value });
  },
  progress: (root, value) => {
    const bar = root.querySelector("progress");
    if (value === null) bar?.removeAttribute("value");
    else if (bar) bar.value = value;
  },
};

// What the server says of attributes of which the page itself decides for now (`lockHolds`), by the widget.
/** @type {Map<HTMLElement, Attributes>} */
const withheld = new Map();

/** @param {HTMLElement} root @param {Attributes} attributes */
export function showAttributes(root, attributes) {
  for (const [name, value] of Object.entries(attributes)) showAttribute(root, name, value);
}

/** @param {HTMLElement} root @param {string} name @param {Data} value */
function showAttribute(root, name, value) {
  const fromServer = withheld.get(root);
  if (fromServer && name in fromServer) {
    fromServer[name] = value;
    return;
  }
  const show = hooksOf(root).show?.[name] ?? SHOW[name];
  if (show) show(root, value);
  else showInPlace(root, name, value);
}

/** @param {HTMLElement} root @param {string} name @param {Data} value */
function showInPlace(root, name, value) {
  setText(root.querySelector(`[data-text="${name}"]`), value ?? "");
  const meter = /** @type {HTMLMeterElement | null} */ (root.querySelector(`[data-value="${name}"]`));
  if (meter) meter.value = value ?? meter.min;
  root.querySelector(`[data-width="${name}"]`)?.setAttribute("width", `${value ?? 0}%`);
  if (root.hasAttribute(`data-${name}`)) root.setAttribute(`data-${name}`, value ?? "");
}

// What fails in one widget shows there, and leaves the others as they are.
/** @param {HTMLElement} root @param {() => void} work */
export function attempt(root, work) {
  if ("failed" in root.dataset) return;
  try {
    work();
  } catch (error) {
    root.dataset.failed = "";
    showFailed(root, pageGuard.page.sentences.broken);
    console.error(`widget "${root.dataset.widget}" can not be shown`, error);
  }
}

// Locks a widget that can't be shown, for good: what it shows is no longer updated.
/** @param {HTMLElement} root @param {string} text */
function showFailed(root, text) {
  for (const button of root.querySelectorAll("button")) button.disabled = true;
  if (root.dataset.state) root.dataset.state = "unreadable";
  for (const name of ["reason", "note"]) setText(root.querySelector(`[data-text="${name}"]`), text);
}

// Without a connection no permission is known and each value is old. Its note keeps the time of the value.
/** @param {HTMLElement} root @param {string} lost @param {string} unknown */
export function lockWidget(root, lost, unknown) {
  if (root.querySelector(".cancel:enabled")) setText(root.querySelector('[data-text="doing"]'), unknown);
  const buttons = root.querySelectorAll("button[type=submit], button.hold");
  for (const button of buttons) button.disabled = true;
  root.querySelector(".ask:popover-open")?.hidePopover();
  const reason = root.querySelector(".why")?.dataset.lost ?? lost; // of a stop button: what to use instead
  if (buttons.length) showAttributes(root, { reason, reasons: reason, more: "", enabled: false });
  // The tile of a robot.
  if ("link_state" in root.dataset) {
    showAttributes(root, { link_state: "wait", link: unknown, since: "", alarm: unknown, priority: "" });
  }
  if (!root.dataset.state) return;
  root.dataset.state = "old";
  if (!root.dataset.shape) return;
  Object.assign(root.dataset, { shape: "old", colour: "none" });
  setText(root.querySelector('[data-text="text"]'), unknown);
}

// Shows the receipt of a press at its widget, and none at the others.
/** @param {Iterable<HTMLElement>} widgets @param {HTMLElement} root @param {Receipt} receipt */
export function showReceipt(widgets, root, { id, outcome, reason, brief }) {
  if (outcome === "succeeded") releaseEntry(root);
  root.dispatchEvent(new CustomEvent("receipt", { bubbles: true, detail: { outcome } }));
  for (const widget of widgets) {
    const old = widget.querySelector(".receipt");
    if (old) showOutcome(old, "", "");
  }
  // The result of a call is an attribute of the widget, shown in every browser. The receipt of a cancel has
  // no id: the goal's state shows that the cancel was requested.
  const shared = id ? outcome !== "refused" : outcome === "accepted";
  if (root.querySelector(".result") && shared && !brief) return;
  showOutcome(find(root, ".receipt"), outcome, brief ?? reason);
  if (brief) reportStop(isGood(outcome) ? "" : reason);
}

// What a stop button has to say beside its few words: why it is locked, or which robot may go on. It stands over the top
// of the page, takes no touch and goes by itself: a stop button opens nothing.

const STOP_SHOWN_MS = 60_000;

let stopTimer = 0;

// An empty text is none.
/** @param {string} text */
export function reportStop(text) {
  clearTimeout(stopTimer);
  const report = find(document, ".stop-report");
  report.textContent = text;
  report.hidden = !text;
  if (text) stopTimer = setTimeout(() => reportStop(""), STOP_SHOWN_MS);
}

// A sentence of the page's own over its top, which takes no touch and goes by itself.

const REPORT_SHOWN_MS = 8000;
let reportTimer = 0;

// `name` is that of the sentence in the markup.
/** @param {"notAsked" | "otherFinger"} name */
export function reportOnPage(name) {
  const text = find(document, ".page-report");
  clearTimeout(reportTimer);
  text.textContent = text.dataset[name] ?? "";
  text.hidden = false;
  reportTimer = setTimeout(() => (text.hidden = true), REPORT_SHOWN_MS);
}

// While something lies over the page, such as the keypad, the page itself locks all holds.

const LOCK_TEXTS = ["reason", "reasons", "more"];
let covers = 0; // how many lie over it

/** @param {string | undefined} reason */
export function lockHolds(reason) {
  covers += 1;
  if (covers > 1) return;
  for (const root of document.querySelectorAll("[data-widget]:has(.hold)")) {
    const texts = LOCK_TEXTS.map((name) => [name, root.querySelector(`[data-text="${name}"]`)?.textContent]);
    const fromServer = { enabled: !find(root, "button.hold").disabled, ...Object.fromEntries(texts) };
    showAttributes(root, { enabled: false, reason, reasons: reason, more: "" });
    withheld.set(root, fromServer);
  }
}

// After the last one the server's lock shows again, as it is by now.
export function unlockHolds() {
  covers -= 1;
  if (covers) return;
  const locks = [...withheld];
  withheld.clear();
  for (const [root, lock] of locks) showAttributes(root, lock);
}

// A group whose buttons are all locked for one reason says it once, beside its title, if it has room there.

const LEAST = 2; // buttons

/** @param {HTMLElement} key */
const reasonOf = (key) => [...key.querySelectorAll(".why, .reasons")].map((text) => text.textContent.trim()).join("\n");

// Called after a change of these keys; `isLocked` tells of each.
/** @param {Iterable<HTMLElement>} keys @param {(key: HTMLElement) => boolean} isLocked */
function sayOnce(keys, isLocked) {
  const groups = new Set([...keys].map((key) => closest(key, ".group:has(> .head > .said)")));
  for (const group of groups) if (group) showReason(group, isLocked);
}

/** @param {HTMLElement} group @param {(key: HTMLElement) => boolean} isLocked */
function showReason(group, isLocked) {
  const said = find(group, ".said");
  const keys = [...group.querySelectorAll('.key, [data-kind="step"]')];
  const [reason, ...others] = new Set(keys.map((key) => (isLocked(key) ? reasonOf(key) : "")));
  const isOne = keys.length >= LEAST && reason && !others.length;
  setText(find(said, "span"), isOne ? find(keys[0], '.why [data-text="reason"]').textContent : "");
  group.toggleAttribute("data-said", Boolean(isOne));
  if (isOne && isReasonCut(said)) group.toggleAttribute("data-said", false);
}

// Also where the head is not shown, as where groups take turns.
/** @param {HTMLElement} text */
function isReasonCut(text) {
  const { scrollHeight, clientHeight, scrollWidth, clientWidth } = text;
  return !clientHeight || scrollHeight > clientHeight + 1 || scrollWidth > clientWidth + 1;
}

// Texts of keys that are cut. A touch on a locked key opens a sheet with why it is locked and what to do, and so does the
// "…" of the key, which a keyboard reaches. A touch on the bar of control shows its text in full.
export const KEY_TEXTS = ".reasons, .why, .goal, .holding, .receipt, .result";
/** @type {typeof import("./whole-text.js") | null} */
let sheet = null; // when it was needed

const AT_REST_MS = 4000;
/** @type {(error: unknown) => void} */
const noop = () => {};

const KEYS = '.key, [data-kind="step"], [data-kind="switch"]';

/** @param {HTMLElement} key */
export function isLocked(key) {
  return key.dataset.enabled ? key.dataset.enabled === "false" : key.querySelector("button")?.disabled === true;
}

/** @param {HTMLElement} text */
function isCut(text) {
  return text.scrollHeight > text.clientHeight + 1 || text.scrollWidth > text.clientWidth + 1;
}

/** @param {HTMLElement} key */
const isStopKey = (key) => [...key.children].some(isStop);

// A locked key has it always: the button itself has no focus. On a stop that can be pressed nothing else is touched.
/** @param {HTMLElement} key @param {boolean} cut */
function showMore(key, cut) {
  const more = find(key, ".more");
  const isWhole = !cut && !key.querySelector('[data-text="more"]')?.textContent;
  const isComplete = !isLocked(key) && (isWhole || isStopKey(key));
  more.toggleAttribute("hidden", isComplete && document.activeElement !== more);
  more.toggleAttribute("data-clipped", cut);
  const focused = document.activeElement;
  if (isLocked(key) && focused?.matches("button:disabled") && key.contains(focused)) more.focus();
  sheet?.follow(key);
}

/** @param {HTMLElement} key */
function lockTexts(key) {
  return find(key, key.querySelector(".reasons") ? ".reasons" : ".why").textContent.trim();
}

/** @type {Set<HTMLElement>} */
const changed = new Set(); // keys whose face or size is another since the last frame

/** @param {HTMLElement} key */
function mark(key) {
  if (!changed.size) requestAnimationFrame(markAll);
  changed.add(key);
}

// After all texts of the page have other letters.
export function measureKeys() {
  for (const key of document.querySelectorAll(KEYS)) mark(key);
}

// All are measured before the first is changed: the page is laid out once.
function markAll() {
  const keys = [...changed].map((key) => ({
    key,
    cut: [...key.querySelectorAll(":is(.face, .told) > p")].some(isCut),
  }));
  changed.clear();
  for (const { key, cut } of keys) showMore(key, cut);
  const roots = keys.map(({ key }) => key);
  sayOnce(roots, isLocked);
}

// A key, or a step or a switch, whose two keys have one text.
/** @param {HTMLElement} key @param {() => Promise<typeof import("./whole-text.js")>} load */
function equipKey(key, load) {
  const face = find(key, ".face, .reported, .told");
  const more = copyOf(find(document, "template#more"));
  more.setAttribute("aria-describedby", find(key, "button").getAttribute("aria-describedby") ?? "");
  more.addEventListener("blur", () => mark(key));
  face.append(more);
  const observer = new MutationObserver(() => mark(key));
  const texts = { childList: true, characterData: true, subtree: true };
  for (const text of face.querySelectorAll(KEY_TEXTS)) observer.observe(text, texts);
  for (const button of key.querySelectorAll("button")) observer.observe(button, { attributeFilter: ["disabled"] });
  new ResizeObserver(() => mark(key)).observe(key);
  key.addEventListener("click", (event) => {
    if (!closest(event.target, ".more") && (!isLocked(key) || closest(event.target, "button"))) return;
    if (isStopKey(key)) reportStop(lockTexts(key));
    else load().then(({ open }) => open(key, event.detail === 0), noop);
  });
}

// Once, when the page starts. `loadSheet` brings the script of the sheet, which comes when the page is at rest, or at the
// first touch: without a server a lock still says why.
/** @param {() => Promise<typeof import("./whole-text.js")>} loadSheet */
export function equipKeys(loadSheet) {
  const load = () => loadSheet().then((script) => (sheet = script));
  setTimeout(() => load().catch(noop), AT_REST_MS);
  for (const key of document.querySelectorAll(KEYS)) equipKey(key, load);
  const control = document.querySelector("#control");
  control?.querySelector("div")?.addEventListener("click", () => {
    load().then(({ openControl }) => openControl(control), noop);
  });
}

// The groups of a page that fits, one at a time where they have no room side by side.
const groups = document.querySelectorAll("[data-group]");
const tabs = document.querySelectorAll(".group-tab");

/** @param {string | undefined} number */
function showGroup(number) {
  for (const group of groups) group.classList.toggle("shown", group.dataset.group === number);
  for (const tab of tabs) tab.setAttribute("aria-pressed", String(tab.dataset.shows === number));
}

for (const tab of tabs) tab.addEventListener("click", () => showGroup(tab.dataset.shows));

// An address that names a widget shows its group.
function showNamed() {
  showGroupOf(document.getElementById(location.hash.slice(1)));
}

// The group of an element, where one is shown at a time.
/** @param {Element | null} element */
export function showGroupOf(element) {
  const group = element?.closest("[data-group]");
  if (group instanceof HTMLElement && tabs.length) showGroup(group.dataset.group);
}

addEventListener("hashchange", showNamed);
showNamed();
