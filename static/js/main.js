// Connects the event stream to the page: each event updates its section of the markup.
import { followEntries, loadTouchEntry } from "./entries.js";
import { Presser } from "./press.js";
import { addHooks, attempt, find, lockWidget, setText, showAttributes } from "./show.js";
import { Source } from "./source.js";

const AT_REST_MS = 4000; // after the first snapshot
/** @type {(data?: Data) => void} */
const noop = () => {};
// What is shown of a section that is the same on every page.
const COMMON = { link: showLink, notice: showNotice, state: showState, robots: showRobots };

class Screen {
  #data = pageGuard.page;
  #clock = find(document, "time#clock"); // shows the time of the last heartbeat
  #reconnected = false; // a snapshot has arrived after a loss, and no heartbeat after it yet
  #widgets = new Map(
    [...document.querySelectorAll("[data-widget]:not([data-failed])")].map((root) => [root.dataset.widget ?? "", root]),
  );
  /** @type {string[]} */
  #atRest = []; // the kinds whose script comes when the page shows all else
  #source;
  #presser;
  #control = { show: noop, lost: noop, beat: noop }; // a page without the bar does not require control
  #alarms = { show: noop, control: noop, lost: noop }; // of a panel without alarms
  #recipes = { showRecipes: noop }; // of another page

  constructor() {
    /** @type {Handlers} */
    const shown = {
      ...COMMON,
      widgets: (changes) => this.#showWidgets(changes),
      control: (state) => {
        this.#control.show(state);
        this.#alarms.control(state.role);
      },
      alarms: (alarms) => this.#alarms.show(alarms),
      recipes: (revisions) => this.#recipes.showRecipes(revisions),
    };
    // The sections of a snapshot, by the server's table. Each is an event by itself when it changes.
    const sections = Object.fromEntries(this.#data.sections.map((name) => [name, shown[name]]));
    this.#source = new Source({
      snapshot: (all) => this.#showAll(all, sections),
      update: sections.widgets,
      // What changed in several widgets at once, such as the lock of an interlock.
      updates: ({ groups }) => {
        for (const { widgets, attributes } of groups) for (const id of widgets) this.#showWidget(id, attributes);
      },
      ...sections,
      browser: noop, // this client's id: for programs
      beat: (now) => this.#beat(now),
      lost: () => this.#lockAll(),
    });
    this.#presser = new Presser(this.#widgets, this.#source);
  }

  async start() {
    const bar = document.querySelector("form#control");
    if (bar) this.#control = new (await import("./control.js")).Control(bar, (event) => this.#source.timeOf(event));
    this.#load();
    window.operatorPanel = { eventAgeMs: () => this.#source.ageMs }; // for the watcher of a kiosk's screen
    pageGuard.onFail = () => this.#source.stop();
    if (!pageGuard.isBroken) this.#source.start();
  }

  // What this page needs besides. The stream waits for what shows a part of a snapshot.
  #load() {
    const source = this.#source;
    if (document.querySelector("[data-step]")) source.load(import("./inputs.js"), noop);
    if (document.querySelector("[data-poll]")) import("./diagnostics.js").catch(pageGuard.fail);
    for (const kind of this.#data.kinds) {
      // The server has drawn it, and nothing in it is pressed: its script waits for all that is.
      const waits = kind === "trend" && !document.querySelector(".trend-keys");
      if (waits) this.#atRest.push(kind);
      else this.#equip(kind);
    }
    if (document.querySelector(".alarm-line"))
      source.load(import("./alarm-line.js"), ({ AlarmLine }) => (this.#alarms = new AlarmLine(source)));
    if (document.querySelector("a.user")) import("./session.js").catch(pageGuard.fail);
    if (document.querySelector("[data-recipes]"))
      source.load(import("./recipes.js"), (recipes) => (this.#recipes = recipes));
    if (document.querySelector(".group-tab")) source.load(import("./tabs.js"), noop);
    source.load(import("./full-text.js"), noop);
    if (document.querySelector("template:is(#keypad, #keyboard)")) loadTouchEntry(this.#data.keyboard);
    if (document.querySelector("[data-scan]")) import("./entry/scan.js").catch(pageGuard.fail);
    if (this.#data.sounds) import("./sound.js").catch(pageGuard.fail);
    import("./floor/floor.js").catch(pageGuard.fail);
  }

  /** @param {string} kind */
  #equip(kind) {
    /** @type {Promise<Hooks>} */
    const script = import(`./kinds/${kind}.js`);
    this.#source.load(script, (hooks) => {
      addHooks(kind, hooks);
      for (const root of document.querySelectorAll(`[data-kind="${kind}"]`))
        attempt(root, () => hooks.equip?.(root, this.#source));
    });
  }

  /** @param {Data} all @param {Handlers} sections */
  #showAll(all, sections) {
    if (all.revision !== this.#data.revision) {
      this.#lockAll();
      this.#source.stop();
      return pageGuard.reload(true);
    }
    this.#reconnected = "cut" in document.body.dataset;
    delete document.body.dataset.cut;
    for (const [name, show] of Object.entries(sections)) show(all[name]);
    for (const kind of this.#atRest.splice(0)) setTimeout(() => this.#equip(kind), AT_REST_MS);
  }

  /** @param {Record<string, Attributes>} changes */
  #showWidgets(changes) {
    for (const [id, attributes] of Object.entries(changes)) this.#showWidget(id, attributes);
  }

  /** @param {string} id @param {Attributes} attributes */
  #showWidget(id, attributes) {
    const root = this.#widgets.get(id);
    if (!root) return;
    attempt(root, () => showAttributes(root, attributes));
  }

  /** @param {Record<string, string>} now */
  #beat(now) {
    for (const name of ["clock", "day"]) setText(document.getElementById(name), now[name]);
    this.#clock.dateTime = now.at;
    if (this.#reconnected) setText(document.querySelector('[data-link="server"] [data-text="since"]'), now.clock);
    this.#reconnected = false;
    this.#control.beat();
  }

  // The connection to the server is lost: no permission is known any more.
  #lockAll() {
    this.#presser.close();
    document.body.dataset.cut = "";
    this.#control.lost();
    this.#alarms.lost();
    const { lostShort: text, locksAll: locks, lost, unknown } = this.#data.sentences;
    showState({ state: "lost", text });
    showLamp("server", { state: "bad", text, since: this.#clock.textContent, locks, reason: lost });
    for (const name of ["bridge", "node"]) {
      showLamp(name, { state: "wait", text: unknown, since: "", locks: "", reason: "" });
    }
    for (const tab of document.querySelectorAll("[data-robot]")) {
      tab.dataset.state = "wait";
      setText(tab.querySelector("b"), unknown);
    }
    for (const root of this.#widgets.values()) attempt(root, () => lockWidget(root, lost, unknown));
  }
}

export function start() {
  followEntries();
  return new Screen().start();
}

/** @param {Record<string, Lamp>} lamps */
function showLink(lamps) {
  for (const [name, { since, ...lamp }] of Object.entries(lamps)) {
    showLamp(name, name === "server" ? lamp : { since, ...lamp }); // this page's own link to the server
  }
}

/** @param {string} name @param {Lamp} lamp */
function showLamp(name, lamp) {
  const light = find(document, `[data-lamp="${name}"]`);
  const row = find(document, `[data-link="${name}"]`);
  light.dataset.state = row.dataset.state = lamp.state;
  setText(light.querySelector("b"), lamp.text);
  for (const [key, text] of Object.entries(lamp)) setText(row.querySelector(`[data-text="${key}"]`), text);
}

// The link status of each robot, on its tab.
/** @param {Record<string, Lamp>} robots */
function showRobots(robots) {
  for (const [id, lamp] of Object.entries(robots)) {
    const tab = find(document, `[data-robot="${id}"]`);
    tab.dataset.state = lamp.state;
    setText(tab.querySelector("b"), lamp.text);
  }
}

/** @param {{ state: string, text: string }} lamp */
function showState({ state, text }) {
  const box = find(document, "#state");
  box.dataset.state = state;
  setText(box.querySelector("b"), text);
}

/** @param {Record<string, string>} notice */
function showNotice(notice) {
  for (const [id, text] of Object.entries(notice)) {
    const element = find(document, `#${id}`);
    setText(element, text);
    element.hidden = !text;
  }
}
