// Is in the page itself, before anything is shown, in every browser: ES5 only. Says that a browser is too old, else
// starts the modules. A page of which a module is missing or throws is locked, and loads again later.
(function () {
  var STARTS_WITHIN_MS = 10000;
  var LONGEST_PAUSE_S = 30; // between two reloads
  var SETTLED_MS = 60000; // a page that works for so long forgets its reloads
  var RELOADS = "reloads";

  var main = document.querySelector("script[data-src]").getAttribute("data-src");
  var started = false;
  var reloading = false;
  var page = JSON.parse(document.getElementById("page").textContent);
  var guard = (window.pageGuard = {
    page: page,
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
    setTimeout(function () {
      if (!started) fail("the page did not start");
    }, STARTS_WITHIN_MS);
  }

  function onStarted() {
    started = true;
    setTimeout(keep, SETTLED_MS, RELOADS, null);
  }

  // Locks the page for good.
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

  function refuse(event) {
    if (event.target.matches(".page, .control")) event.preventDefault();
  }

  // Sets a property or an attribute of all these elements; only what differs, as it is called after each change.
  function show(selector, name, value) {
    document.querySelectorAll(selector).forEach(function (element) {
      if (name.indexOf("data-") < 0) element[name] === value || (element[name] = value);
      else if (element.getAttribute(name) !== value) element.setAttribute(name, value);
    });
  }

  function lock() {
    var words = page.sentences;
    show("form.page [type=submit], form.control [type=submit], .hold", "disabled", true);
    document.querySelectorAll("dialog[popover]").forEach(function (dialog) {
      if (dialog.hidePopover && dialog.matches(":popover-open")) dialog.hidePopover();
    });
    show('form.page :is([data-text="reason"], [data-text="reasons"])', "textContent", words.faulty);
    show('form.page [data-text="more"]', "textContent", "");
    show("[data-widget][data-state]", "data-state", "old");
    show("[data-widget][data-shape]", "data-shape", "old");
    show("[data-widget][data-shape]", "data-colour", "none");
    show(":is([data-lamp], [data-robot]) b", "textContent", words.unknown);
    show("[data-lamp], [data-robot]", "data-state", "wait");
    show("#state", "data-state", "unknown");
    show("#state b", "textContent", words.stateUnknown);
    show("#fault", "textContent", words.faulty);
    show("#fault", "hidden", false);
    show("body", "data-cut", "");
    show("body", "data-locked", "");
  }

  // After 1, 2, 4 … 30 s, as often as it was in vain, and when the server answers; `atOnce`: the first time.
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
  function recall(name) {
    try {
      return sessionStorage.getItem(name);
    } catch (error) {
      return (history.state || {})[name];
    }
  }

  function keep(name, value) {
    try {
      if (value === null) sessionStorage.removeItem(name);
      else sessionStorage.setItem(name, value);
    } catch (error) {
      var state = Object.assign({}, history.state);
      state[name] = value;
      history.replaceState(state, "");
    }
  }

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
