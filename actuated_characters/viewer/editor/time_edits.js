// Keys and events that are dragged along the time line, and the keyboard; time_edits.py hears of it.
(() => {
  const SLOP = 3, AWAY = 60; // pixels: no drag yet; beside the time line, from where a drag is none
  const EDGE = 6; // pixels at the end of what lasts, by which its end is dragged
  const ACTS = { c: "copy", v: "paste", z: "undo", y: "redo" }; // with Ctrl
  const line = window.timeLine, { bar, track } = line;
  let held = null, asked = ""; // what is dragged; what was chosen, of which the page is not yet told
  let count = Math.random(); // so that no text is sent twice

  const send = (act, ...values) =>
    line.update(line.told.edits, JSON.stringify([count++, line.told.document, act, ...values]));
  const markOf = item => line.told.marks.find(each => each.item === item);
  const isAtEnd = (part, event) => { // of what is long enough to be moved as well
    const box = part.getBoundingClientRect();
    return part.classList.contains("mode") && box.width > 2 * EDGE
      && event.clientX > box.right - EDGE;
  };

  function place(at) { // where what is dragged begins, or ends
    const { style } = held.part;
    if (held.act === "move") style.left = line.percent(at);
    else style.width = `calc(${line.percent(at)} - ${style.left})`;
  }
  function letGo() {
    place(held.start);
    held.part.classList.remove("held");
    line.tip.style.display = "none";
    held = null;
  }
  function follow(event) {
    const way = event.clientX - held.from;
    if (!held.moved && Math.abs(way) < SLOP) return;
    held.moved = true;
    held.part.classList.add("held");
    const { told } = line, box = track.getBoundingClientRect();
    const at = held.start + way / box.width * (told.last - told.first);
    const snapped = Math.round(at / told.step) * told.step;
    const isAway = event.clientY < box.top - AWAY || event.clientY > box.bottom + AWAY;
    held.at = isAway ? held.start : Math.min(Math.max(snapped, held.least), told.last);
    place(held.at);
    line.say(held.at, isAway ? ["stays"] : []);
  }
  const own = event => { event.stopPropagation(); event.preventDefault(); };

  track.addEventListener("pointerdown", event => {
    const part = event.target.closest("[data-item]");
    if (event.button !== 0 || !line.told) return;
    if (!part) { // the time line goes there by itself
      if (line.told.chosen || asked) send("choose", asked = "");
      return;
    }
    own(event);
    document.activeElement?.blur(); // or a field of the panel would keep the keys
    track.setPointerCapture(event.pointerId);
    const { item } = part.dataset, { start: begin, end } = markOf(item), { first, step } = line.told;
    const [act, start, least] = isAtEnd(part, event) ? ["end", end, begin + step]
      : ["move", begin, first];
    held = { part, item, act, start, least, at: start, from: event.clientX, moved: false,
      document: line.told.document };
  }, true);
  track.addEventListener("pointermove", event => {
    const part = event.target.closest?.("[data-item].mode");
    if (!held) part?.classList.toggle("end", isAtEnd(part, event));
    if (!held) return;
    own(event);
    follow(event);
  }, true);
  track.addEventListener("pointerup", event => {
    if (!held) return;
    own(event);
    follow(event);
    const { item, act, start, at, moved, part } = held;
    if (Math.abs(at - start) > 1e-9) { // it stays there until the marks come anew
      held = null;
      send(act, item, at);
      return;
    }
    letGo();
    if (moved) return;
    send("choose", asked = item);
    line.seek(part.classList.contains("mode") ? line.timeOf(event) : start);
  }, true);
  const abort = () => { if (held) letGo(); };
  track.addEventListener("lostpointercapture", abort);
  track.addEventListener("pointercancel", abort, true);
  addEventListener("blur", abort);
  track.addEventListener("click", event => { // by the keyboard
    const part = event.target.closest("[data-item]");
    if (part && event.detail === 0) send("choose", part.dataset.item);
  }, true);

  addEventListener("keydown", event => {
    if (event.key === "Escape" && held) {
      own(event);
      letGo();
      return;
    }
    if (!line.told || event.altKey || !line.isFree(event)) return;
    const isWithControl = event.ctrlKey || event.metaKey, key = event.key.toLowerCase();
    const isDelete = key === "delete" || key === "backspace";
    let act = isWithControl ? ACTS[key] : isDelete ? "delete" : undefined;
    if (act === "undo" && event.shiftKey) act = "redo";
    if (!act || (act === "copy" && String(getSelection()))) return; // a text is copied by the browser
    own(event);
    send(act);
  }, true);

  function show() {
    const { told, time } = line;
    for (const part of track.querySelectorAll("[data-item]")) {
      const { item } = part.dataset, isKey = item.startsWith("keys/");
      const isHere = isKey && !told.chosen && item.startsWith(`keys/${told.layer}/`)
        && Math.abs(markOf(item).start - time) < 5e-4;
      part.classList.toggle("chosen", isHere || item === told.chosen);
    }
  }
  bar.addEventListener("marks", () => {
    asked = "";
    if (held) {
      held.part = track.querySelector(`[data-item="${held.item}"]`);
      if (!held.part || held.document !== line.told.document) held = null;
      else place(held.at);
    }
    show();
  });
  bar.addEventListener("time", show);
})();
