// The time line at the bottom of a recorded run's page; time_bar.py says how it is connected.
(() => {
  const FRAME = "/time_line", ADDRESS = "/time_line.json";
  const MODES = 14, LEAST_LABEL = 11, ROW = 10; // pixels: all modes, one with its name, a row of keys
  const NEAR = 5; // pixels between the pointer and a mark that it means
  const SEND_PERIOD = 40; // ms between two times that are sent during a drag
  const LEAP = 0.1; // s that an arrow key goes with Shift
  const BEYOND = 1e-7; // s: no rounded time, which the panel's slider would not be told of again
  const NOT_OURS = "input, textarea, select, [contenteditable], [role=slider], [role=dialog]";
  let told = null, asked = -1, time = 0, plays = false, drags = false, sentAt = 0, spoken = "";
  const make = (tag, name, parent) => {
    const made = document.createElement(tag);
    made.className = name;
    parent?.append(made);
    return made;
  };
  const bar = make("section", "", null);
  bar.id = "time-line";
  bar.hidden = true;
  bar.setAttribute("aria-label", "Time line");
  const play = make("button", "play", bar), shown = make("div", "time", bar);
  const track = make("div", "track", bar), rail = make("div", "rail", track);
  const now = make("div", "now", track), tip = make("div", "tip", track);
  Object.entries({ role: "slider", tabindex: 0, "aria-label": "Time in seconds" }).forEach(
    ([name, value]) => rail.setAttribute(name, value));
  tip.style.display = "none";

  const update = (uuid, value) => window.__viserMutable.sendMessage(
    { type: "GuiUpdateMessage", uuid, updates: { value } });
  const press = button => update(told.playback, button);
  const seek = to => to >= told.last ? press("End") : to <= told.first ? press("Start")
    : update(told.slider, Math.min(to + BEYOND, told.last));
  const share = at => (at - told.first) / Math.max(told.last - told.first, 1e-9);
  const percent = at => `${100 * Math.min(Math.max(share(at), 0), 1)}%`;

  const most = kinds => Math.max(0, ...told.marks.filter(({ kind }) => kinds(kind)).map(({ lane }) => lane));
  const lanes = () => 1 + most(kind => kind === "mode");
  const modes = () => told.laneHeight ? told.laneHeight * lanes() : MODES;

  function draw(mark, ghost) {
    const isMode = mark.kind === "mode";
    const made = make(isMode ? "div" : "button", `${isMode ? "" : "mark "}${mark.kind}`, track);
    if (mark.item) made.dataset.item = mark.item;
    made.style.left = percent(mark.start);
    if (mark.end > mark.start) made.style.width = `calc(${percent(mark.end)} - ${percent(mark.start)})`;
    if (ghost) made.classList.add("ghost");
    if (isMode) { // of several characters one below the other
      const count = lanes(), [top, height] = ghost ? [modes() + 29, 11] : [0, modes()];
      made.style.cssText += `background: ${mark.color}; top: ${top + height * mark.lane / count}px;
        height: ${height / count}px`;
      if (height / count >= LEAST_LABEL) made.textContent = mark.label;
    } else if (mark.lane) made.style.marginTop = `${ROW * mark.lane}px`;
    made.dataset.made = "";
    if (!isMode) {
      made.setAttribute("aria-label", `${mark.start.toFixed(2)} s: ${ghost}${mark.text}`);
      made.onclick = event => { if (event.detail === 0) seek(mark.start); }; // by the keyboard
    }
  }

  function drawTicks() { // a dozen at most, at round times
    const { first, last } = told, least = Math.max(last - first, 1e-3) / 12;
    const decade = 10 ** Math.floor(Math.log10(least));
    const every = decade * [1, 2, 5, 10].find(each => decade * each >= least - 1e-9);
    for (let tick = Math.ceil(first / every - 1e-9); tick * every <= last + 1e-9; tick++) {
      const made = make("div", "tick", track);
      made.style.left = percent(tick * every);
      made.dataset.at = Number((tick * every).toFixed(4));
      made.dataset.made = "";
    }
  }

  async function fetchMarks(version) {
    asked = version;
    const found = await fetch(ADDRESS).then(response => response.json()).catch(() => null);
    if (version !== asked) return; // a newer one was asked for meanwhile
    if (!found?.slider) { setTimeout(() => { asked = -1; }, 1000); return; }
    if (found.version !== asked) return; // the page will be told of it, and ask again
    told = found;
    track.querySelectorAll("[data-made]").forEach(each => each.remove());
    const ghost = told.ghost && `${told.ghost}: `;
    told.ghostMarks = told.ghostMarks.filter(({ kind, start }) => start <= told.last
      && kind !== "keyframe" && kind !== "end");
    drawTicks();
    const all = [...told.marks.map(each => [each, ""]), ...told.ghostMarks.map(each => [each, ghost])];
    for (const wanted of [true, false])
      all.filter(([each]) => (each.kind === "mode") === wanted).forEach(each => draw(...each));
    track.classList.toggle("two", told.ghostMarks.length > 0);
    track.style.setProperty("--modes", `${modes()}px`);
    track.style.setProperty("--rows", `${ROW * most(kind => kind !== "mode")}px`);
    rail.setAttribute("aria-valuemin", told.first);
    rail.setAttribute("aria-valuemax", told.last);
    track.append(now, tip);
    bar.hidden = false;
    bar.dispatchEvent(new Event("marks"));
  }

  const timeOf = event => {
    const box = track.getBoundingClientRect();
    const part = Math.min(Math.max((event.clientX - box.x) / box.width, 0), 1);
    return told.first + part * (told.last - told.first);
  };
  const marksNear = at => {
    const near = NEAR * (told.last - told.first) / track.clientWidth;
    const named = each => ({ ...each, text: `${told.ghost}: ${each.text}` });
    return [...told.marks, ...told.ghostMarks.map(named)].filter(
      ({ kind, start, end }) => kind === "mode" ? start <= at && at < end
        : start - near <= at && at <= end + near);
  };
  track.onpointerdown = event => {
    track.setPointerCapture(event.pointerId);
    drags = true;
    const at = timeOf(event);
    const moments = marksNear(at).filter(({ kind }) => kind !== "mode");
    moments.sort((one, other) => Math.abs(one.start - at) - Math.abs(other.start - at));
    seek(moments.length ? moments[0].start : at);
    document.activeElement?.blur(); // or a field of the panel would keep the keys
    event.preventDefault();
  };
  function say(at, texts) {
    tip.style.display = "block";
    tip.style.left = percent(at);
    tip.textContent = [`${at.toFixed(2)} s`, ...texts].join("\n");
    const over = tip.getBoundingClientRect(), room = bar.getBoundingClientRect();
    const aside = Math.max(room.left - over.left, 0) + Math.min(room.right - over.right, 0);
    tip.style.left = `calc(${percent(at)} + ${aside}px)`;
  }
  track.onpointermove = event => {
    const at = timeOf(event), { step } = told;
    say(step ? Math.round(at / step) * step : at, marksNear(at).map(({ text }) => text));
    if (drags && performance.now() - sentAt > SEND_PERIOD) {
      sentAt = performance.now();
      seek(at);
    }
  };
  track.onpointerup = event => { if (drags && sentAt) seek(timeOf(event)); drags = false; sentAt = 0; };
  track.onpointercancel = () => { drags = false; sentAt = 0; };
  track.onpointerleave = () => { tip.style.display = "none"; };
  play.onclick = () => press(plays ? "Pause" : "Play");

  const KEYS = {
    " ": () => press(plays ? "Pause" : "Play"),
    ArrowLeft: leaps => leaps ? seek(time - LEAP) : press("-1"),
    ArrowRight: leaps => leaps ? seek(time + LEAP) : press("+1"),
    Home: () => press("Start"),
    End: () => press("End"),
  };
  // A control that the keyboard has come to keeps its keys; a button that was clicked does not.
  let isByMouse = false; // how the keyboard's focus has come to where it is
  addEventListener("pointerdown", () => { isByMouse = true; }, true);
  const isFree = ({ target }) => bar.contains(target)
    || !target.closest?.(isByMouse ? NOT_OURS : `${NOT_OURS}, button`);
  let taken = false; // the key that is down was ours
  addEventListener("keydown", event => {
    if (event.key === "Tab") isByMouse = false;
    const act = KEYS[event.key];
    taken = false;
    if (!act || !told || event.ctrlKey || event.metaKey || event.altKey || !isFree(event)) return;
    event.preventDefault();
    event.stopPropagation(); // or viser would turn the camera by the arrow keys
    taken = true;
    act(event.shiftKey);
  }, true);
  addEventListener("keyup", event => { // on which a button would be pressed by space
    if (event.key === " " && (taken || bar.contains(event.target))) event.preventDefault();
  }, true);

  // Beside the panel where it reaches down to the bar, else as wide as the page.
  function place() {
    let panel = told && document.getElementById(told.slider), edge = innerWidth;
    for (; panel && panel !== document.body; panel = panel.parentElement)
      if (["absolute", "fixed"].includes(getComputedStyle(panel).position)) {
        const box = panel.getBoundingClientRect();
        const isBeside = box.width < 0.5 * innerWidth && box.left > 0.4 * innerWidth;
        if (isBeside && box.bottom > bar.getBoundingClientRect().top) edge = Math.min(edge, box.left);
      }
    bar.style.width = `${edge - 24}px`;
  }
  function show() {
    requestAnimationFrame(show);
    const at = window.__viserMutable?.nodePoseData?.[FRAME]?.position;
    if (!at) return;
    const version = Math.floor(at[2] / 2);
    if (version && version !== asked) fetchMarks(version);
    if (!told) return;
    [time, plays] = [at[0] + at[1], at[2] % 2 === 1];
    const line = `${time.toFixed(3)} / ${told.last.toFixed(2)} s`;
    if (line + plays === spoken) return;
    spoken = line + plays;
    shown.textContent = line;
    now.style.left = percent(time);
    bar.dispatchEvent(new Event("time"));
    play.textContent = plays ? "❚❚" : "▶";
    play.setAttribute("aria-label", plays ? "Pause" : "Play");
    const mode = told.marks.find(({ kind, start, end }) => kind === "mode" && start <= time && time < end);
    rail.setAttribute("aria-valuenow", time.toFixed(3));
    rail.setAttribute("aria-valuetext", `${time.toFixed(3)} s${mode ? `, ${mode.label}` : ""}`);
  }
  // for scripts that come after this one
  window.timeLine = { bar, track, tip, update, seek, percent, say, timeOf, isFree,
    get told() { return told; }, get time() { return time; } };
  addEventListener("DOMContentLoaded", () => {
    document.body.append(bar);
    setInterval(place, 250);
    show();
  });
})();
