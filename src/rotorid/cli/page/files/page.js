"use strict";
// The page of `rotorid page`. All that comes from logs is set as text, never as HTML.
const $ = (id) => document.getElementById(id);
const current = $("current"), status = $("status"), alertBox = $("alert");
let shownId = "", shownKey = "", timer = 0, seen = [], token = 0;

function el(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes || {})) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...children.flat().filter((c) => c !== null && c !== undefined && c !== ""));
  return node;
}
const list = (sentences, attributes) => el("ul", attributes, sentences.map((s) => el("li", {}, s)));
const say = (text) => { if (status.textContent !== text) status.textContent = text; };
function warn(text) { alertBox.hidden = !text; alertBox.textContent = text || ""; }
const size = (bytes) => bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`;

async function ask(method, path, body) {
  const options = { method };
  if (body instanceof Blob) options.body = body;
  else if (body !== undefined) { options.body = JSON.stringify(body); options.headers = { "Content-Type": "application/json" }; }
  let answer;
  try { answer = await fetch("api/" + path, options); } catch {
    throw new Error("The page's program does not answer; start `rotorid page` again. Nothing that was kept is lost.");
  }
  if (answer.status === 204) return null;
  const text = await answer.text();
  let said;
  try { said = JSON.parse(text); } catch { said = { sentence: text.trim() }; }
  if (!answer.ok) throw new Error(said.sentence || `the page answered ${answer.status}`);
  return said;
}

// Past sets ----------------------------------------------------------------------------------------
const WORDS = { new: "no log came", looked: "looked at, not asked yet", waiting: "waits for its turn", working: "being worked on" };
async function listSets() {
  const sets = (await ask("GET", "sets")).filter((s) => s.name || s.stage !== "new");
  $("past").hidden = !sets.length;
  $("sets").replaceChildren(...sets.map((s) => {
    const day = new Date(s.made_s * 1000).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
    return el("li", {},
      el("button", { class: "go", type: "button", "aria-current": s.id === shownId ? "true" : null, onclick: () => open(s.id) },
        el("strong", {}, s.name || "no log"), el("span", { class: "line", title: s.sentence }, `${day}: ${s.sentence || WORDS[s.stage] || ""}`)),
      el("button", { type: "button", "aria-label": `Delete ${s.name}, ${day}`, onclick: () => remove(s) }, "Delete"));
  }));
}
async function remove(set) {
  if (!confirm(`Delete ${set.name || "this set"} with its logs and answers from this page's folder?`)) return;
  await guarded(async () => {
    await ask("DELETE", `sets/${set.id}`);
    if (set.id === shownId) close();
    say(`${set.name || "The set"} is deleted.`);
    await listSets();
    $("logs").focus();
  });
}
function close() {
  shownId = shownKey = ""; clearTimeout(timer); token++;
  current.hidden = true; current.replaceChildren(); $("drop").className = "";
  history.replaceState(null, "", "#");
}
async function guarded(work) {
  warn("");
  try { return await work(); } catch (error) { say(""); warn(error.message); return undefined; }
}

// A drop -------------------------------------------------------------------------------------------
async function take(files) {
  if (!files.length) return;
  await guarded(async () => {
    clearTimeout(timer);
    const mine = ++token, { id } = await ask("POST", "sets");
    try {
      for (const { file, bag } of files) {
        say(`Taking ${file.name}, ${size(file.size)} …`);
        await ask("PUT", `sets/${id}/logs/${encodeURIComponent(file.name)}?bag=${encodeURIComponent(bag)}`, file);
      }
    } catch (error) {
      await ask("DELETE", `sets/${id}`).catch(() => null);
      throw error;
    }
    say("Looking …");
    const state = await ask("POST", `sets/${id}/look`, {});
    await listSets();
    if (mine === token) show(state);
    else say(`${state.name} is in the list.`);
  });
}
const plain = (files) => [...files].map((file) => ({ file, bag: "" }));
const fileOf = (entry) => new Promise((found, failed) => entry.file(found, failed));
// The files right in a folder; those of a ROS 2 bag stay together.
async function inside(folder) {
  const reader = folder.createReader(), entries = [];
  for (let part = null; !part || part.length; entries.push(...part)) part = await new Promise((found, failed) => reader.readEntries(found, failed));
  const bag = entries.some((e) => e.name === "metadata.yaml") ? folder.name : "";
  return Promise.all(entries.filter((e) => e.isFile && !e.name.startsWith(".")).map(async (e) => ({ file: await fileOf(e), bag })));
}
$("logs").addEventListener("change", (event) => { take(plain(event.target.files)); event.target.value = ""; });
for (const name of ["dragenter", "dragover"]) document.addEventListener(name, (e) => { e.preventDefault(); $("zone").classList.add("over"); });
document.addEventListener("dragleave", (e) => { if (!e.relatedTarget) $("zone").classList.remove("over"); });
document.addEventListener("drop", (e) => {
  e.preventDefault();
  $("zone").classList.remove("over");
  const items = [...e.dataTransfer.items].map((i) => i.webkitGetAsEntry && i.webkitGetAsEntry());
  if (!items.some((i) => i && i.isDirectory)) { take(plain(e.dataTransfer.files)); return; }
  guarded(async () => take((await Promise.all(items.filter(Boolean).map(async (i) => (i.isDirectory ? inside(i) : [{ file: await fileOf(i), bag: "" }])))).flat()));
});

// The set that is shown -----------------------------------------------------------------------------
async function open(id) { token++; await guarded(async () => show(await ask("GET", `sets/${id}`))); }
function poll(id) {
  clearTimeout(timer);
  timer = setTimeout(async () => {
    if (id !== shownId) return;
    try { const state = await ask("GET", `sets/${id}`); if (id === shownId) show(state); } catch (error) { warn(error.message); poll(id); }
  }, 1000);
}
function show(state) {
  const first = state.id !== shownId, key = state.id + state.stage, changed = key !== shownKey;
  if (first) seen = [];
  shownId = state.id; shownKey = key;
  history.replaceState(null, "", "#" + state.id);
  $("drop").className = "small";
  current.hidden = false;
  const working = state.stage === "waiting" || state.stage === "working";
  if (working) {
    if (changed) { current.replaceChildren(...waiting(state)); seen = []; }
    progress(state);
    poll(state.id);
  } else {
    clearTimeout(timer);
    current.replaceChildren(...(state.stage === "done" ? answer(state) : looked(state)));
    say(state.stage === "done" ? "The answer is there." : state.stage === "looked" ? "Looked at." : "");
  }
  if (changed) { current.focus({ preventScroll: !first }); listSets().catch(() => null); }
}
const title = (text) => el("h2", { id: "current-title" }, text);

function waiting(state) {
  return [
    title(`${state.name}: ${state.question === "compare" ? "comparing" : "working on the verdict"}`),
    el("progress", { "aria-label": "at work" }),
    el("p", { id: "line", class: "soft" }),
    el("ol", { id: "steps", class: "steps" }),
    el("div", { id: "said" }),
    el("p", { class: "soft" }, "You may close this tab, or drop more logs: they queue. The work goes on while the program runs."),
    el("div", { class: "actions" }, el("button", { type: "button", onclick: () => guarded(async () => show(await ask("POST", `sets/${state.id}/stop`, {}))) }, "Stop")),
  ];
}
function progress(state) {
  const now = state.now || {}, step = now.step || "";
  if (state.stage === "waiting") {
    $("line").textContent = state.before ? `Waits for its turn; ${state.before} before it.` : "Starts now.";
    say(state.before ? "Waits for its turn." : "Starts now.");
    return;
  }
  $("line").textContent = now.line || "Starting: the libraries take some seconds.";
  if (step && seen[seen.length - 1] !== step) {
    seen = [...seen.filter((s) => s !== step), step];
    say(`Now: ${step}.`);
  }
  $("steps").replaceChildren(...seen.map((s, n) => el("li", n === seen.length - 1 ? { class: "now", "aria-current": "step" } : {}, s)));
  if ((state.said || []).length) {
    if (!$("said").hasChildNodes()) say("What differs is known.");
    $("said").replaceChildren(el("h3", {}, "What differs"), list(state.said));
  }
}

function answer(state) {
  const base = `api/sets/${state.id}/files/`, file = (name) => base + encodeURIComponent(name);
  const exports = state.exports || [], of = new Set(exports.map((e) => e.file));
  const plain = state.files.filter((f) => !of.has(f.name));
  const download = (name, bytes) => el("a", { href: file(name) + "?download", download: name }, `${name} (${size(bytes)})`);
  const bytes = Object.fromEntries(state.files.map((f) => [f.name, f.bytes]));
  return [
    title(state.name),
    el("p", { class: "headline" }, state.sentence),
    state.said.length > 1 ? list(state.said) : state.said.length ? el("p", {}, state.said[0]) : null,
    el("p", { class: "soft" }, `It took ${Math.round(state.seconds)} s. `, el("a", { href: file(state.page), target: "_blank", rel: "noopener" }, "The report in a tab of its own")),
    el("iframe", { src: file(state.page), title: `Report on ${state.name}`, sandbox: "allow-scripts allow-popups" }),
    el("h3", {}, "Files"),
    el("ul", { class: "files" }, plain.map((f) => el("li", {}, download(f.name, f.bytes)))),
    exports.length ? el("h3", {}, "The improved vehicle for other tools") : null,
    exports.length ? el("ul", {}, exports.map((e) => el("li", {},
      el("strong", {}, e.form), ": ", e.file ? download(e.file, bytes[e.file]) : "none",
      e.left_out.length ? el("details", {}, el("summary", {}, e.file ? `What it leaves out (${e.left_out.length})` : "Why"), list(e.left_out)) : null))) : null,
    el("div", { class: "actions" }, el("button", { type: "button", onclick: () => again(state) }, "Ask again with other values")),
  ].filter(Boolean);
}
function again(state) { current.replaceChildren(...looked({ ...state, stage: "looked", sentence: "" })); current.focus(); }

const SVG = "http://www.w3.org/2000/svg";
function layout(rotors) {
  // Seen from above, nose up: x of the body is up, y to the right. An arrow over each rotor shows how it turns.
  const far = Math.max(...rotors.map((r) => Math.hypot(r.x_m, r.y_m))) || 1, radius = rotors.length > 4 ? 13 : 20;
  const svg = document.createElementNS(SVG, "svg");
  const put = (tag, attributes, text) => {
    const node = document.createElementNS(SVG, tag);
    for (const [k, v] of Object.entries(attributes)) node.setAttribute(k, v);
    if (text) node.textContent = text;
    svg.append(node);
  };
  svg.setAttribute("viewBox", "-80 -88 160 168");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", "Rotors seen from above, nose up: " + rotors.map((r, n) =>
    `rotor ${n + 1} ${r.x_m >= 0 ? "front" : "rear"} ${r.y_m >= 0 ? "right" : "left"}, turning ${r.spin === "cw" ? "clockwise" : "counter-clockwise"}`).join("; "));
  put("path", { d: "M0 -86 l6 10 h-12 z", class: "tip" });
  rotors.forEach((r) => put("line", { x1: 0, y1: 0, x2: 54 * r.y_m / far, y2: -54 * r.x_m / far, class: "arm" }));
  rotors.forEach((r, n) => {
    const x = 54 * r.y_m / far, y = -54 * r.x_m / far, s = r.spin === "cw" ? 1 : -1, a = radius * 0.72;
    put("circle", { cx: x, cy: y, r: radius, class: "disc" });
    put("path", { d: `M${x - s * a} ${y + 4} A${a} ${a} 0 0 ${s > 0 ? 1 : 0} ${x + s * a} ${y}`, class: "spin" });
    put("path", { d: `M${x + s * a - 4} ${y - 1} h8 l-4 7 z`, class: "tip" });
    put("text", { x, y: y + 4 }, String(n + 1));
  });
  return svg;
}

function looked(state) {
  const look = state.look, out = [title(state.name)];
  if (state.sentence) out.push(el("p", { class: "alert", role: "alert" }, state.sentence));
  if (!look) {
    if (state.logs.length) out.push(el("div", { class: "actions" }, el("button", { type: "button", onclick: () => again_look(state, {}) }, "Look again")));
    return out;
  }
  const form = look.runs ? about(state, out) : columns(state, out);
  out.push(form);
  return out;
}
async function again_look(state, wishes) {
  await guarded(async () => { say("Looking …"); show(await ask("POST", `sets/${state.id}/look`, wishes)); });
}

function columns(state, out) {
  const look = state.look;
  out.push(el("p", {}, `A ${look.format}. Its columns are not named as the contract has them; this is what they seem to be.`));
  if (look.open.length) out.push(el("div", { class: "note" }, el("h3", {}, "To be answered (replace each '?' below)"), list(look.open)));
  out.push(el("details", {}, el("summary", {}, "Why they seem so"), list([...look.evidence, ...look.left_out])));
  const text = el("textarea", { id: "mapping", spellcheck: "false" });
  text.value = (state.wishes && state.wishes.mapping) || look.mapping;
  return el("form", { onsubmit: (e) => { e.preventDefault(); again_look(state, { mapping: text.value }); } },
    el("div", { class: "field" }, el("label", { for: "mapping" }, "What the columns are"), text),
    el("button", { class: "first" }, "Look with this"));
}

function about(state, out) {
  const look = state.look, runs = look.runs, total = runs.reduce((s, r) => s + r.duration_s, 0), wishes = state.wishes || {};
  const rotors = look.rotors.length, several = runs.length > 1;
  out.push(el("p", { class: "headline" }, `${look.format}: ${runs.length} ${look.kind === "flight" ? (several ? "flights" : "flight") : (several ? "runs" : "run")}, ${total.toFixed(0)} s in all, a vehicle of ${rotors} rotors.`));
  out.push(el("div", { class: "wide" }, el("table", {},
    el("thead", {}, el("tr", {}, ["flight", "length", "rate", "gaps", "longest"].map((h) => el("th", { scope: "col" }, h)))),
    el("tbody", {}, runs.map((r) => el("tr", {}, el("th", { scope: "row" }, r.name), el("td", {}, `${r.duration_s.toFixed(1)} s`),
      el("td", {}, `${Number(r.rate_hz.toPrecision(3))} Hz`), el("td", {}, String(r.gaps)), el("td", {}, r.gaps ? `${Number(r.longest_gap_s.toPrecision(2))} s` : "–")))))));
  if (look.doubts.length) out.push(el("div", { class: "note" }, el("h3", {}, "Looks wrong"), list(look.doubts.map((d) => d.sentence))));
  out.push(el("div", { class: "columns" },
    el("div", {}, el("h3", {}, "What can be asked"), list(look.can.length ? look.can : ["Nothing: forces and moments are missing."])),
    el("div", {}, el("h3", {}, "What cannot, and why"), list(look.cannot.length ? look.cannot : ["Nothing that the contract knows is missing."]))));
  if (look.found.length) out.push(el("details", {}, el("summary", {}, `Found in the log (${look.found.length})`), list(look.found)));

  const mass = el("input", { id: "mass", type: "number", min: "0.001", max: "9999", step: "any", required: true, "aria-describedby": "mass-why", inputmode: "decimal" });
  if (wishes.mass_kg) mass.value = wishes.mass_kg;
  else if (!look.unknown_vehicle) mass.value = Number(look.mass_kg.toPrecision(4));
  const like = el("select", { id: "like", required: true, "aria-describedby": "like-why" },
    look.like ? null : el("option", { value: "" }, "choose the nearest"),
    look.templates.map((t) => el("option", { value: t.name, selected: t.name === look.like }, `${t.name}: ${t.says}`)));
  const vehicle = el("textarea", { id: "vehicle", spellcheck: "false", "aria-describedby": "vehicle-why" });
  vehicle.value = look.vehicle;
  const mapping = look.mapping ? el("textarea", { id: "mapping", spellcheck: "false" }) : null;
  if (mapping) mapping.value = look.mapping;
  const own = () => vehicle.value !== look.vehicle || Boolean(wishes.vehicle);
  const values = () => ({
    mass_kg: mass.value ? Number(mass.value) : null, like: like.value, mapping: mapping ? mapping.value : "",
    vehicle: own() ? vehicle.value : "",
  });
  const change = () => {
    if (own()) return;  // what was written by hand stays
    if (like.value && mass.value) again_look(state, values());
  };
  // The mass that was proposed is that of the old template: a new template proposes its own.
  like.addEventListener("change", () => { if (!wishes.mass_kg && !own()) again_look(state, { ...values(), mass_kg: null }); else change(); });
  mass.addEventListener("change", change);

  const compare = state.logs.length > 1;
  const question = (value, text, checked) => el("label", { class: "radio" }, el("input", { type: "radio", name: "question", value, checked }), " ", text);
  const asked = compare ? el("select", { id: "asked" }, state.logs.map((n) => el("option", { value: n, selected: n === (state.in_question || state.logs[state.logs.length - 1]) }, n))) : null;
  const go = el("button", { class: "first" }, compare ? "Ask" : "Give the verdict");
  const form = el("form", {},
    el("h3", {}, "What must be known"),
    wishes.vehicle ? el("p", { class: "note" }, "The vehicle is the one that you wrote below; mass and template play no part. Empty the text to return to the proposal.") : null,
    el("div", { class: "field" }, el("label", { for: "mass" }, "Mass as flown, with battery, kg"), mass,
      el("p", { class: "why", id: "mass-why" }, look.unknown_vehicle ? "The log does not say it. Weigh the vehicle: every force stands on it." : `Why this: ${look.mass_why}.`)),
    el("div", { class: "field" }, el("label", { for: "like" }, "Vehicle it is most like"), like,
      el("p", { class: "why", id: "like-why" }, look.unknown_vehicle ? "The log does not say what vehicle it is. What the log does not hold (arms, inertia, propellers) is taken from the nearest one." : "What the log does not hold is taken from it, scaled by mass, and trusted little.")),
    el("div", { class: "layout" }, layout(look.rotors), el("div", { class: "why" }, list(look.remarks))),
    el("details", { open: Boolean(wishes.vehicle) }, el("summary", {}, "The vehicle in full (vehicle.yaml), to correct what you know better"),
      el("p", { class: "why", id: "vehicle-why" }, "What you write here is taken as it is, in place of mass and template."),
      el("label", { for: "vehicle", class: "hidden" }, "vehicle.yaml"), vehicle),
    mapping ? el("details", {}, el("summary", {}, "What the columns are"), el("label", { for: "mapping", class: "hidden" }, "mapping"), mapping) : null,
    compare ? el("fieldset", {}, el("legend", {}, "The question"),
      question("verdict", "What does the model leave out, over all logs together?", true),
      question("compare", "What changed? Held against the others:", false), asked,
      el("label", { for: "asked", class: "hidden" }, "The log in question")) : null,
    look.refused ? el("p", { class: "note" }, `A verdict will be refused: ${look.refused}`) : null,
    el("div", { class: "actions" }, go, el("button", { type: "button", onclick: () => again_look(state, values()) }, "Look again with these values")));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    go.disabled = true;
    const chosen = compare ? form.elements.question.value : "verdict";
    guarded(async () => show(await ask("POST", `sets/${state.id}/ask`, { ...values(), question: chosen, in_question: asked ? asked.value : "" })))
      .then(() => { go.disabled = false; });
  });
  return form;
}

$("home").addEventListener("click", (event) => { event.preventDefault(); close(); say(""); warn(""); listSets(); $("logs").focus(); });
guarded(async () => {
  await listSets();
  const id = location.hash.slice(1);
  if (/^[0-9]{8}-[0-9a-f]{12}$/.test(id)) await open(id);
});
