// Starts the editor's page: its header, its keys and its panes.
import * as adding from "./adding.js";
import * as arrange from "./arrange.js";
import * as change from "./change.js";
import * as curve from "./curve.js";
import * as merge from "./merge.js";
import * as outline from "./outline.js";
import * as panes from "./panes.js";
import * as preview from "./preview.js";
import { select } from "./selection.js";
import * as sending from "./send.js";
import * as starting from "./start.js";
import { edit, onMessage, onState, open, say, state, step } from "./wire.js";

/** @param {string} id */
const get = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** @param {string} attribute @param {string} value */
function press(attribute, value) {
  for (const button of document.querySelectorAll(`[data-${attribute}]`))
    button.setAttribute("aria-pressed", String(button.getAttribute(`data-${attribute}`) === value));
}

/** @type {Record<string, (value: string) => void>} */
const CHOICES = {
  size: (value) => {
    const [width, height] = value.split("x").map(Number);
    preview.setSize(width, height);
  },
  language: (value) => {
    preview.setChoice("language", value);
    panes.fill(get("pages"), "pages", { language: value });
  },
  "theme-of": (value) => preview.setChoice("theme", value),
  mode: (value) => document.body.classList.toggle("trying", value === "try"),
};

for (const [name, choose] of Object.entries(CHOICES)) {
  for (const button of document.querySelectorAll(`[data-${name}]`)) {
    button.addEventListener("click", () => {
      const value = button.getAttribute(`data-${name}`) ?? "";
      press(name, value);
      choose(value);
    });
  }
}

/** @param {"undo" | "redo" | "save"} name */
async function take(name) {
  const answer = await step(name);
  if (answer?.select) select(answer.select, "edit");
  if (name === "save") merge.openMerge();
}
for (const name of /** @type {const} */ (["undo", "redo", "save"]))
  get(name).addEventListener("click", () => take(name));

document.addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
  const key = event.key.toLowerCase();
  const inText = event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement;
  if (key === "s") panes.entered().then(() => take("save"));
  else if (inText) return;
  else if (key === "z") take(event.shiftKey ? "redo" : "undo");
  else if (key === "y") take("redo");
  else return;
  event.preventDefault();
});

onState((now, before) => {
  get("status").textContent = now.status;
  get("undo").toggleAttribute("disabled", !now.undo);
  get("redo").toggleAttribute("disabled", !now.redo);
  const title = get("stage-title");
  title.textContent = (now.faults ? title.dataset.faulty : title.dataset.good) ?? "";
  title.classList.toggle("faulty", now.faults > 0);
  get("fault-count").textContent = String(now.faults);
  get("fault-count").hidden = !now.faults;
  if (now.drawn !== before.drawn) areKeysOld = true;
});

// The address of a page that is closed is gone with it: what is not saved is said first, until something else is done.
let isWarned = false;
const warn = () => say(isWarned ? (get("close").dataset.unsaved ?? "") : "");
document.addEventListener("click", (event) => {
  const isClose = event.target instanceof Element && event.target.closest("#close");
  if (isClose ? state.saved || isWarned : !isWarned) return;
  if (isClose) event.preventDefault();
  isWarned = Boolean(isClose);
  warn();
});
onState((now) => {
  if (!isWarned) return;
  isWarned = !now.saved;
  warn();
});

let areKeysOld = false;
preview.onDrawn(() => {
  if (areKeysOld) panes.fill(get("pages"), "pages", shownLanguage());
  areKeysOld = false;
});

/** @returns {Record<string, string>} */
function shownLanguage() {
  const chosen = document.querySelector('[data-language][aria-pressed="true"]');
  return chosen ? { language: chosen.getAttribute("data-language") ?? "" } : {};
}

onMessage((text) => {
  get("message").textContent = text;
  get("message").hidden = !text;
});

get("pages").addEventListener("click", (event) => {
  const target = event.target instanceof Element ? event.target : null;
  const key = target?.closest("[data-page]");
  if (key?.dataset.page) preview.showPage(key.dataset.page);
  if (target?.closest("[data-add-page]")) starting.ask();
});

// The editor itself is light or dark as its reader's system is.
const isDark = matchMedia("(prefers-color-scheme: dark)");
const showTheme = () => {
  document.documentElement.dataset.theme = isDark.matches ? "dark" : "light";
};
isDark.addEventListener("change", showTheme);
showTheme();

// The page may be in another language and theme than the file says, as this browser has chosen before.
function markChoices() {
  const { lang, dataset } = preview.shownDocument()?.documentElement ?? {};
  if (lang && lang !== shownLanguage().language) {
    press("language", lang);
    panes.fill(get("pages"), "pages", shownLanguage());
  }
  if (dataset?.theme) press("theme-of", dataset.theme);
}
preview.onDrawn(markChoices);

get("faults").addEventListener("click", (event) => {
  const button = event.target instanceof Element ? event.target.closest("[data-repair]") : null;
  if (button?.dataset.repair) edit(JSON.parse(button.dataset.repair));
});

function markPage() {
  for (const key of get("pages").querySelectorAll("[data-page]")) {
    if (key.dataset.page === preview.shownPage()) key.setAttribute("aria-current", "page");
    else key.removeAttribute("aria-current");
  }
}
preview.onDrawn(markPage);
panes.onPane((pane) => pane === get("pages") && markPage());

panes.start();
outline.start();
preview.start();
arrange.start();
change.start();
curve.start();
merge.start();
adding.start();
starting.start();
sending.start();
open();
