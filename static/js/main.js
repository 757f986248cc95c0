// Connects the event stream to the page: each event updates its section of the markup.
import { showLamp, showLink, showRobots } from "./connection.js";
import { Presser } from "./press.js";
import { addShow, lockWidget, setText, showAttribute, showFailed } from "./show.js";
import { Source } from "./source.js";

const body = document.body;
const clock = document.getElementById("clock"); // shows the time of the last heartbeat
let reconnected = false; // a snapshot has arrived after a loss, and no heartbeat after it yet
const widgets = new Map(
  [...document.querySelectorAll("[data-widget]:not([data-failed])")].map((root) => [root.dataset.widget, root]),
);

// What fails in one widget shows there, and leaves the others as they are.
function attempt(root, work) {
  if ("failed" in root.dataset) return;
  try {
    work();
  } catch (error) {
    root.dataset.failed = "";
    showFailed(root, body.dataset.broken);
    console.error(`widget "${root.dataset.widget}" can not be shown`, error);
  }
}

function showWidget(id, attributes) {
  const root = widgets.get(id);
  if (!root) return;
  attempt(root, () => {
    for (const [name, value] of Object.entries(attributes)) showAttribute(root, name, value);
  });
}

// A page without the bar does not require control.
const bar = document.getElementById("control");
const noop = () => {};
const control = bar
  ? new (await import("./control.js")).Control(bar, (event) => source.timeOf(event))
  : { show: noop, lost: noop, beat: noop };

function showWidgets(changes) {
  for (const [id, attributes] of Object.entries(changes)) showWidget(id, attributes);
}

function showState({ state, text }) {
  const box = document.getElementById("state");
  box.dataset.state = state;
  setText(box.querySelector("b"), text);
}

function showNotice(notice) {
  for (const [id, text] of Object.entries(notice)) {
    const element = document.getElementById(id);
    setText(element, text);
    element.hidden = !text;
  }
}

// The connection to the server is lost: no permission is known any more.
function lockAll() {
  presser.close();
  body.dataset.cut = "";
  control.lost();
  const { lostShort, locksAll, lost, unknown } = body.dataset;
  showState({ state: "lost", text: lostShort });
  showLamp("server", { state: "bad", text: lostShort, since: clock.textContent, locks: locksAll, reason: lost });
  for (const name of ["bridge", "node"]) {
    showLamp(name, { state: "wait", text: unknown, since: "", locks: "", reason: "" });
  }
  for (const tab of document.querySelectorAll("[data-robot]")) {
    tab.dataset.state = "wait";
    setText(tab.querySelector("b"), unknown);
  }
  for (const root of widgets.values()) attempt(root, () => lockWidget(root, lost, unknown));
}

// The sections of a snapshot, in the order in which they are shown. Each is an event by itself when it changes.
const SECTIONS = {
  control: (state) => control.show(state),
  widgets: showWidgets,
  link: showLink,
  notice: showNotice,
  state: showState,
  robots: showRobots,
};

const source = new Source({
  snapshot(all) {
    if (all.revision !== body.dataset.revision) {
      lockAll();
      source.stop();
      pageGuard.reload(true);
      return;
    }
    reconnected = "cut" in body.dataset;
    delete body.dataset.cut;
    for (const [name, show] of Object.entries(SECTIONS)) show(all[name]);
  },
  update: showWidgets,
  // What changed in several widgets at once, such as the lock of an interlock.
  updates({ groups }) {
    for (const { widgets: alike, attributes } of groups) for (const id of alike) showWidget(id, attributes);
  },
  ...SECTIONS,
  browser: noop, // this client's id: for programs
  beat(now) {
    setText(clock, now.clock);
    clock.dateTime = now.at;
    if (reconnected) setText(document.querySelector('[data-link="server"] [data-text="since"]'), now.clock);
    reconnected = false;
    control.beat();
  },
  lost: lockAll,
});

if (document.querySelector("[data-step]")) source.load("./inputs.js", () => {});
// Widget kinds with a script: it equips each widget of the kind, and may add functions that show attributes.
for (const kind of body.dataset.scripts.split(" ").filter(Boolean)) {
  const roots = document.querySelectorAll(`[data-kind="${kind}"]`);
  source.load(`./kinds/${kind}.js`, ({ equip, show }) => {
    addShow(show);
    for (const root of roots) attempt(root, () => equip?.(root, source));
  });
}
if (document.querySelector(".group-tab")) source.load("./tabs.js", () => {});
source.load("./full-text.js", () => {});
// The stream does not wait for these.
const coarse = matchMedia("(pointer: coarse)");
const openEntry = () => import("./entry/touch-entry.js").catch(pageGuard.fail);
if (document.querySelector("template:is(#keypad, #keyboard)")) {
  if (body.dataset.keyboard === "on" || coarse.matches) openEntry();
  else coarse.addEventListener("change", openEntry, { once: true });
}
if (document.querySelector("[data-scan]")) import("./entry/scan.js").catch(pageGuard.fail);
if (body.dataset.sounds === "on") import("./sound.js").catch(pageGuard.fail);
import("./floor/floor.js").catch(pageGuard.fail);
const presser = new Presser(widgets, source, body.dataset);
window.operatorPanel = { eventAgeMs: () => source.ageMs }; // for the watcher of a kiosk's screen
pageGuard.onFail = () => source.stop();
if (!pageGuard.isBroken) source.start();
