"""What runs in each page of the kiosk: the look of the watcher, and the keys that lead nowhere."""

from typing import Final

DRAWS_WITHIN_MS: Final = 1500

# A page with a stream whose scripts did not load is as old as its document.
LOOK: Final = f"""(async () => {{
    const drawn = await new Promise((done) => {{
        requestAnimationFrame(() => done(true));
        setTimeout(() => done(false), {DRAWS_WITHIN_MS});
    }});
    const streams = document.getElementById("page") !== null;
    const ageMs = window.operatorPanel ? window.operatorPanel.eventAgeMs() : performance.now();
    return {{
        url: location.href,
        ours: "theme" in document.documentElement.dataset,
        age_s: streams ? ageMs / 1000 : null,
        drawn,
    }};
}})()"""

# The browser's shortcuts, its context menu, zoom and history. Editing in a text field stays.
KEEP_IN: Final = """(() => {
    const EDITS = /^([acvxyz]|Arrow.*|Backspace|Delete|Home|End)$/i;
    const LEADS_OUT = /^(F\\d+|(Browser|Launch|Zoom).*|Open|New|Print|Save|Close|Help|Find|.*Menu)$/;
    const stop = (event) => event.preventDefault();
    addEventListener("keydown", (event) => {
        const edits = event.ctrlKey && !event.altKey && !event.metaKey && EDITS.test(event.key);
        const combined = event.ctrlKey || event.altKey || event.metaKey;
        if ((combined && !edits) || LEADS_OUT.test(event.key)) stop(event);
    }, true);
    addEventListener("contextmenu", stop, true);
    addEventListener("wheel", (event) => event.ctrlKey && stop(event), { passive: false });
    for (const name of ["mousedown", "mouseup"]) {
        addEventListener(name, (event) => event.button > 2 && stop(event), true);
    }
})()"""
