// Puts what the server says onto the page: texts and attributes, in place. It composes no sentence.
import { Source } from "./source.js";
import { Presser, showBounds, showEntry } from "./press.js";

const body = document.body;
const clock = document.getElementById("clock"); // shows the last heartbeat's
let back = false; // the server is there again, and its first heartbeat has not come
const widgets = new Map(
  [...document.querySelectorAll("[data-widget]")].map((root) => [root.dataset.widget, root]),
);

function setText(element, text) {
  if (element && element.textContent !== text) element.textContent = text;
}

// How each attribute of a widget is shown; what is not here has places of its own: `data-text` for a text,
// `data-value` for the value of an element such as a meter, and an attribute of the widget's root.
function showInPlace(root, name, value) {
  setText(root.querySelector(`[data-text="${name}"]`), value ?? "");
  const measured = root.querySelector(`[data-value="${name}"]`);
  if (measured) measured.value = value ?? measured.min;
  if (root.hasAttribute(`data-${name}`)) root.setAttribute(`data-${name}`, value ?? "");
}

const SHOW = {
  enabled: (root, value) => {
    root.querySelector("button[type=submit], .hold").disabled = !value;
    if (!value) root.querySelector("dialog.ask")?.close();
  },
  stoppable: (root, value) => {
    const cancel = root.querySelector(".cancel");
    if (cancel) cancel.disabled = !value;
  },
  press: (root, value) => {
    const cancel = root.querySelector(".cancel");
    if (cancel) cancel.value = value;
  },
  held: (root, value) => root.toggleAttribute("data-held", value),
  reasons: (root, value) => {
    const list = root.querySelector(".reasons");
    setText(list?.querySelector("p"), value);
    if (!value) list?.hidePopover();
  },
  outcome: (root, value) => (root.querySelector(".result").dataset.outcome = value),
  busy: (root, value) => {
    const bar = root.querySelector("progress");
    if (bar) bar.hidden = !value;
  },
  askable: (root, value) => (root.querySelector(".read").disabled = !value),
  entry: showEntry,
  bounds: showBounds,
  settable: (root, value) => (root.querySelector(".setting").inert = !value),
  progress: (root, value) => {
    const bar = root.querySelector("progress");
    if (value === null) bar?.removeAttribute("value");
    else if (bar) bar.value = value;
  },
};

function showWidget(id, attributes) {
  const root = widgets.get(id);
  if (!root) return;
  for (const [name, value] of Object.entries(attributes)) {
    if (name in SHOW) SHOW[name](root, value);
    else showInPlace(root, name, value);
  }
}

// Where there is no bar, nobody needs control.
const bar = document.getElementById("control");
const nothing = () => {};
const control = bar
  ? new (await import("./control.js")).Control(bar, (event) => source.timeOf(event))
  : { show: nothing, lost: nothing, beat: nothing };

function showWidgets(changes) {
  for (const [id, attributes] of Object.entries(changes)) showWidget(id, attributes);
}

function showLink(lamps) {
  for (const [name, { since, ...lamp }] of Object.entries(lamps)) {
    showLamp(name, name === "server" ? lamp : { since, ...lamp }); // this page's own link to it
  }
}

function showLamp(name, lamp) {
  const light = document.querySelector(`[data-lamp="${name}"]`);
  const row = document.querySelector(`[data-link="${name}"]`);
  light.dataset.state = row.dataset.state = lamp.state;
  setText(light.querySelector("b"), lamp.text);
  for (const [key, text] of Object.entries(lamp)) setText(row.querySelector(`[data-text="${key}"]`), text);
}

// How each of several robots is, on its tab.
function showRobots(robots) {
  for (const [id, lamp] of Object.entries(robots)) {
    const tab = document.querySelector(`[data-robot="${id}"]`);
    tab.dataset.state = lamp.state;
    setText(tab.querySelector("b"), lamp.text);
  }
}

function showNotice(notice) {
  for (const [id, text] of Object.entries(notice)) {
    const element = document.getElementById(id);
    setText(element, text);
    element.hidden = !text;
  }
}

// The server is gone: what was permitted is no longer known to be.
function lockAll() {
  presser.close();
  body.dataset.cut = "";
  control.lost();
  const { lostShort, locksAll, lost, unknown } = body.dataset;
  showLamp("server", { state: "bad", text: lostShort, since: clock.textContent, locks: locksAll, reason: lost });
  for (const name of ["bridge", "node"]) {
    showLamp(name, { state: "wait", text: unknown, since: "", locks: "", reason: "" });
  }
  for (const tab of document.querySelectorAll("[data-robot]")) {
    tab.dataset.state = "wait";
    setText(tab.querySelector("b"), body.dataset.unknown);
  }
  for (const root of widgets.values()) {
    if (root.querySelector(".cancel:enabled")) {
      setText(root.querySelector('[data-text="goal"]'), body.dataset.unknown); // it was under way
    }
    const buttons = root.querySelectorAll("button[type=submit], .hold");
    for (const button of buttons) button.disabled = true;
    root.querySelector("dialog.ask")?.close();
    if (buttons.length) showWidget(root.dataset.widget, { reason: body.dataset.lost, reasons: body.dataset.lost, more: "" });
    if (root.dataset.state) {
      root.dataset.state = "old"; // its note still says from when it is
      if (root.dataset.shape) {
        Object.assign(root.dataset, { shape: "old", colour: "none" });
        setText(root.querySelector('[data-text="text"]'), body.dataset.unknown);
      }
    }
  }
}

// The sections of a snapshot, in the order in which they are shown; each comes alone when it changes.
const SECTIONS = {
  control: (state) => control.show(state),
  widgets: showWidgets,
  link: showLink,
  notice: showNotice,
  robots: showRobots,
};

const source = new Source({
  snapshot(all) {
    if (!source.whole || all.revision !== body.dataset.revision) {
      lockAll();
      source.stop();
      location.reload();
      return;
    }
    back = "cut" in body.dataset;
    delete body.dataset.cut;
    for (const [name, show] of Object.entries(SECTIONS)) show(all[name]);
  },
  update: showWidgets,
  ...SECTIONS,
  browser: nothing, // this client's id: for programs
  beat(now) {
    setText(clock, now.clock);
    if (back) setText(document.querySelector('[data-link="server"] [data-text="since"]'), now.clock);
    back = false;
    control.beat();
  },
  lost: lockAll,
});

if (document.querySelector("[data-step]")) source.load("./inputs.js", () => {});
// Kinds of widgets with a script of their own: it equips each of them, and may show attributes.
for (const kind of body.dataset.scripts.split(" ").filter(Boolean)) {
  const roots = document.querySelectorAll(`[data-kind="${kind}"]`);
  source.load(`./kinds/${kind}.js`, ({ equip, show }) => {
    Object.assign(SHOW, show);
    for (const root of roots) equip?.(root, source);
  });
}
const presser = new Presser(widgets, source, { unsure: body.dataset.unsure });
source.start();
