// Is in the page itself, before anything is shown, in every browser: ES5 only. Says that a browser is too old, else
// starts the modules. A page of which a module is missing or throws is locked, and loads again later.
(function () {
  var ARRIVES_WITHIN_MS = 10000; // the next file of a page that starts; twice as long after each reload
  var LONGEST_WAIT_MS = 120000;
  var LONGEST_PAUSE_S = 30; // between two reloads
  var SETTLED_MS = 60000; // a page that works for so long forgets its reloads
  var RELOADS = "reloads";

  var main = String(/** @type {HTMLElement} */ (document.querySelector("script[data-src]")).getAttribute("data-src"));
  var started = false;
  var reloading = false;
  /** @type {PageData} */
  var page = JSON.parse(/** @type {HTMLElement} */ (document.getElementById("page")).textContent);
  /** @type {PageGuard} */
  var guard = (window.pageGuard = {
    page: page,
    changed: [],
    isBroken: false,
    fail: fail,
    started: onStarted,
    reload: reload,
    recall: recall,
    keep: keep,
  });

  // What the modules and the stylesheets need: with these all else is there.
  function isNewEnough() {
    return (
      "popover" in HTMLElement.prototype &&
      "CSSLayerBlockRule" in window &&
      CSS.supports("selector(:has(a))") &&
      CSS.supports("container-type: inline-size")
    );
  }

  /** @param {() => void} act */
  function onParsed(act) {
    if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", act);
    else act();
  }

  // Nothing of the page is laid out: some old browsers hang there.
  function replacePage() {
    var text = document.createElement("p");
    text.className = "too-old";
    text.textContent = page.sentences.tooOld;
    document.body.textContent = "";
    document.body.appendChild(text);
    document.documentElement.hidden = false;
  }

  function startModules() {
    var script = document.createElement("script");
    script.type = "module";
    script.onerror = fail;
    script.src = main;
    document.head.appendChild(script);
    awaitStart();
  }

  // Waits for the start while files arrive: a slow machine takes minutes for them.
  function awaitStart() {
    var wait = ARRIVES_WITHIN_MS * Math.pow(2, Number(recall(RELOADS)) || 0);
    var arrived = performance.getEntriesByType("resource").length;
    setTimeout(
      function () {
        if (started) return;
        if (performance.getEntriesByType("resource").length > arrived) awaitStart();
        else fail("the page did not start");
      },
      Math.min(wait, LONGEST_WAIT_MS)
    );
  }

  function onStarted() {
    started = true;
    setTimeout(keep, SETTLED_MS, RELOADS, null);
  }

  // Locks the page for good.
  /** @param {unknown} [error] */
  function fail(error) {
    if (guard.isBroken) return;
    guard.isBroken = true;
    console.error("the page is locked:", error);
    if (guard.onFail) guard.onFail();
    onParsed(function () {
      lock();
      new MutationObserver(lock).observe(document.body, {
        subtree: true,
        childList: true,
        attributeFilter: ["disabled", "open"],
      });
    });
    addEventListener("submit", refuse, true); // by a program: buttons are disabled
    reload();
  }

  /** @param {SubmitEvent} event */
  function refuse(event) {
    if (event.target instanceof Element && event.target.matches(".page, .control")) event.preventDefault();
  }

  // Sets an attribute, or the text, of all these elements; only what differs, as it is called after each change.
  /** @param {string} selector @param {string} name @param {string} value */
  function show(selector, name, value) {
    document.querySelectorAll(selector).forEach(function (element) {
      if (element.getAttribute(name) !== value) element.setAttribute(name, value);
    });
  }

  /** @param {string} selector @param {string} text */
  function showTexts(selector, text) {
    document.querySelectorAll(selector).forEach(function (element) {
      if (element.textContent !== text) element.textContent = text;
    });
  }

  function lock() {
    var words = page.sentences;
    show("form.page [type=submit], form.control [type=submit], .hold", "disabled", "");
    document.querySelectorAll("dialog[popover]").forEach(function (dialog) {
      if (dialog.hidePopover && dialog.matches(":popover-open")) dialog.hidePopover();
    });
    showTexts('form.page :is([data-text="reason"], [data-text="reasons"])', words.faulty);
    showTexts('form.page [data-text="more"]', "");
    show("[data-widget][data-state]", "data-state", "old");
    show("[data-widget][data-shape]", "data-shape", "old");
    show("[data-widget][data-shape]", "data-colour", "none");
    showTexts(":is([data-lamp], [data-robot]) b", words.unknown);
    show("[data-lamp], [data-robot]", "data-state", "wait");
    show("#state", "data-state", "unknown");
    showTexts("#state b", words.stateUnknown);
    showTexts("#fault", words.faulty);
    document.querySelectorAll("#fault").forEach(function (element) {
      element.hidden = false;
    });
    show("body", "data-cut", "");
    show("body", "data-locked", "");
  }

  // After 1, 2, 4 … 30 s, as often as it was in vain, and when the server answers; `atOnce`: the first time.
  /** @param {boolean} [atOnce] */
  function reload(atOnce) {
    if (reloading) return;
    reloading = true;
    var count = Number(recall(RELOADS)) || 0;
    keep(RELOADS, count + 1);
    var pause = atOnce === true && !count ? 0 : Math.min(Math.pow(2, count), LONGEST_PAUSE_S);
    setTimeout(probe, 1000 * pause);
  }

  // Without a server the browser would show a page of its own.
  function probe() {
    fetch(main, { cache: "no-store" })
      .then(function (answer) {
        if ([502, 503, 504].indexOf(answer.status) < 0) return location.reload();
        throw answer.status;
      })
      .catch(function () {
        reloading = false;
        reload();
      });
  }

  // What this tab keeps over a reload; in the history where a browser permits no storage.
  /** @param {string} name */
  function recall(name) {
    try {
      return sessionStorage.getItem(name);
    } catch (error) {
      return (history.state || {})[name];
    }
  }

  /** @param {string} name @param {string | number | null} value */
  function keep(name, value) {
    try {
      if (value === null) sessionStorage.removeItem(name);
      else sessionStorage.setItem(name, String(value));
    } catch (error) {
      var state = Object.assign({}, history.state);
      state[name] = value;
      history.replaceState(state, "");
    }
  }

  // What is entered before the modules are there is kept too.
  addEventListener("input", function (event) {
    if (!started) guard.changed.push(event.target);
  });
  addEventListener("error", function (event) {
    if (!started && event.filename && event.filename.indexOf("/static/") > 0) fail(event.error);
  });
  addEventListener("unhandledrejection", function (event) {
    if (!started) fail(event.reason);
  });
  window.matchMedia =
    window.matchMedia ||
    function () {
      return { matches: false, addEventListener: function () {} }; // a mouse
    };
  if (isNewEnough()) onParsed(startModules);
  else {
    document.documentElement.hidden = true;
    onParsed(replacePage);
  }
})();
