"use strict";
// The page's three figures, drawn by uPlot from the numbers in #data. Nothing is fetched.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const el = (id) => document.getElementById(id);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const times = (text) => Array.from(new Float32Array(bytes(text)));
  const series = (packed) =>
    Array.from(new Int16Array(bytes(packed.data)), (v) => (v === -32768 ? null : v * packed.scale));
  const trace = (run, channel) => data.traces.find((t) => t.run === run && t.channel === channel);
  const short = (v) => (v === null || v === undefined ? "–" : Number(v.toPrecision(3)).toString());
  const height = () => (window.innerWidth < 600 ? 240 : 320);

  const chosen = { run: data.main.run, channel: data.main.channel };
  if (!trace(chosen.run, chosen.channel)) {
    chosen.run = data.traces[0].run;
    chosen.channel = data.traces[0].channel;
  }

  function fill(select, pairs, value) {
    select.replaceChildren(...pairs.map(([key, words]) => {
      const option = document.createElement("option");
      option.value = key;
      option.textContent = words;
      option.selected = key === value;
      return option;
    }));
  }

  function axis(label, size) {
    return { label, stroke: css("--soft"), grid: { stroke: css("--line"), width: 1 }, ticks: { stroke: css("--line") },
      size, labelSize: 18, font: "12px system-ui", labelFont: "12px system-ui" };
  }

  // Behind the lines: the band of the noise, and the stretches that were located.
  function behind(band, windows) {
    return (u) => {
      const { ctx, bbox } = u;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      ctx.fillStyle = css("--shade");
      for (const [start, stop] of windows) {
        const x = u.valToPos(start, "x", true);
        ctx.fillRect(x, bbox.top, u.valToPos(stop, "x", true) - x, bbox.height);
      }
      if (band) {
        const top = u.valToPos(band, "y", true);
        ctx.fillStyle = css("--noise");
        ctx.fillRect(bbox.left, top, bbox.width, u.valToPos(-band, "y", true) - top);
      }
      ctx.restore();
    };
  }

  let plots = {};
  function put(id, options, values) {
    const place = el(id);
    if (!place) return null;
    if (plots[id]) plots[id].destroy();
    const u = new uPlot({ width: place.clientWidth, height: height(), ...options }, values, place);
    plots[id] = u;
    return u;
  }

  function drawTime() {
    const t = trace(chosen.run, chosen.channel);
    if (!t) return;
    const about = data.channels[chosen.channel];
    const windows = data.locations
      .filter((l) => l.run === chosen.run && l.channel === chosen.channel)
      .map((l) => [l.start, l.stop]);
    const line = (label, colour, width) => ({ label, stroke: css(colour), width, spanGaps: false,
      value: (u, v) => short(v) });
    put("time", {
      cursor: { drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [axis("time (s)", 38), axis(`error (${about.unit})`, 58)],
      series: [{ label: "time (s)", value: (u, v) => short(v) }, line("as believed", "--before", 1),
        line("improved", "--after", 1)],
      hooks: { drawClear: [behind(about.noise ? 2 * about.noise : 0, windows)] },
    }, [times(t.time), series(t.before), series(t.after)]);
    const thin = data.every > 1 ? ` Every ${data.every}th row is shown.` : "";
    const kind = data.runs[chosen.run].held_out ? "held out" : "fitted";
    el("time-caption").textContent =
      `Measured minus simulated ${about.name} in ${chosen.run} (${kind}). Grey: two sigma of the sensors' noise` +
      (windows.length ? "; tinted: where the mismatch was located." : ".") +
      ` Drag to zoom, double-click for the whole run.${thin}`;
  }

  function drawRegime() {
    const select = el("variable");
    if (!select) return;
    const columns = data.regimes.channels[chosen.channel];
    if (!columns) { el("regime").textContent = "Nothing that was flown is known for this channel."; return; }
    el("regime").replaceChildren();
    delete plots.regime;
    const known = Object.entries(data.regimes.variables).filter(([key]) => columns[key]);
    if (!columns[select.value]) fill(select, known, known.length ? known[0][0] : "");
    const x = series(columns[select.value]);
    const rows = x.map((v, i) => i).filter((i) => x[i] !== null).sort((a, b) => x[a] - x[b]);
    const before = series(columns.before), after = series(columns.after);
    const sorted = rows.map((i) => x[i]);
    const bins = 10, edges = [];
    for (let b = 0; b <= bins; b++) edges.push(Math.floor((b * (rows.length - 1)) / bins));
    const binned = (values) => {
      const out = new Array(rows.length).fill(null);
      for (let b = 0; b < bins; b++) {
        const inside = rows.slice(edges[b], edges[b + 1] + 1).map((i) => values[i]);
        if (inside.length) out[Math.floor((edges[b] + edges[b + 1]) / 2)] =
          Math.sqrt(inside.reduce((s, v) => s + v * v, 0) / inside.length);
      }
      return out;
    };
    const about = data.channels[chosen.channel];
    const dots = (label, colour) => ({ label, stroke: css(colour), paths: () => null, width: 0,
      points: { show: true, size: 3, stroke: css(colour), fill: css(colour) }, value: (u, v) => short(v) });
    const mean = (label, colour) => ({ label, stroke: css(colour), width: 2, spanGaps: true,
      points: { show: true, size: 7, fill: css(colour) }, value: (u, v) => short(v) });
    put("regime", {
      cursor: { drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [axis(data.regimes.variables[select.value], 38), axis(`error (${about.unit})`, 58)],
      series: [{ label: "value", value: (u, v) => short(v) }, dots("as believed", "--before"),
        dots("improved", "--after"), mean("believed, by bin", "--before"), mean("improved, by bin", "--after")],
    }, [sorted, rows.map((i) => before[i]), rows.map((i) => after[i]), binned(before), binned(after)]);
  }

  function drawCorrelation() {
    const c = data.correlation[chosen.channel];
    if (!c || !el("correlation")) return;
    const line = (label, colour) => ({ label, stroke: css(colour), width: 1.5, value: (u, v) => short(v) });
    put("correlation", {
      scales: { x: { time: false } },
      axes: [axis("later by (s)", 38), axis("correlation", 58)],
      series: [{ label: "later by (s)", value: (u, v) => short(v) }, line("as believed", "--before"),
        line("improved", "--after")],
      hooks: { drawClear: [behind(c.band, [])] },
    }, [c.lag_s, c.before, c.after]);
  }

  function draw() { drawTime(); drawRegime(); drawCorrelation(); }

  function channelsOf(run) {
    return Object.entries(data.channels).filter(([key]) => trace(run, key)).map(([key, c]) => [key, c.name]);
  }

  fill(el("run"), Object.entries(data.runs).map(([r, i]) => [r, i.held_out ? `${r} (held out)` : r]), chosen.run);
  fill(el("channel"), channelsOf(chosen.run), chosen.channel);
  if (el("variable")) {
    const best = data.regimes.first || Object.keys(data.regimes.variables)[0];
    fill(el("variable"), Object.entries(data.regimes.variables), best);
    el("variable").addEventListener("change", drawRegime);
  }
  el("run").addEventListener("change", (e) => {
    chosen.run = e.target.value;
    if (!trace(chosen.run, chosen.channel)) chosen.channel = channelsOf(chosen.run)[0][0];
    fill(el("channel"), channelsOf(chosen.run), chosen.channel);
    draw();
  });
  el("channel").addEventListener("change", (e) => { chosen.channel = e.target.value; draw(); });
  const whole = () => { const x = plots.time.data[0]; plots.time.setScale("x", { min: x[0], max: x[x.length - 1] }); };
  el("whole").addEventListener("click", whole);
  el("time").addEventListener("keydown", (e) => {
    const { min, max } = plots.time.scales.x, span = max - min;
    const to = { ArrowLeft: [min - span / 4, max - span / 4], ArrowRight: [min + span / 4, max + span / 4],
      "+": [min + span / 4, max - span / 4], "-": [min - span / 2, max + span / 2] }[e.key];
    if (e.key === "0") whole();
    if (to) { e.preventDefault(); plots.time.setScale("x", { min: to[0], max: to[1] }); }
  });
  let waiting = 0;
  window.addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(draw, 120); });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
