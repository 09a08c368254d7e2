"use strict";
// The page's figures, drawn by uPlot and on a canvas from the numbers in #data. Nothing is fetched.
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

  const chosen = { run: data.main.run, channel: data.main.channel, shown: data.main.shown_s };
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
    const line = (label, colour, width, more) => ({ label, stroke: css(colour), width, spanGaps: false,
      value: (u, v) => short(v), ...more });
    const when = times(t.time), before = series(t.before), after = series(t.after);
    // A vehicle with derivatives is shown without them, too.
    const without = t.without ? [series(t.without)] : [];
    const plain = (width, more) => without.map(() => line("without derivatives", "--soft", width, more));
    // Both figures show the same stretch of time, whichever of them is zoomed.
    const together = { setScale: [(u, key) => {
      const other = u === plots.signal ? plots.time : plots.signal;
      if (key !== "x" || !other) return;
      const { min, max } = u.scales.x, has = other.scales.x;
      if (min !== has.min || max !== has.max) other.setScale("x", { min, max });
    }] };
    el("signal").hidden = !t.measured;
    if (plots.signal) { plots.signal.destroy(); delete plots.signal; }
    if (t.measured) {
      const read = series(t.measured);
      const less = (left) => read.map((v, i) => (v === null || left[i] === null ? null : v - left[i]));
      put("signal", {
        cursor: { drag: { x: true, y: false }, sync: { key: "time" } },
        scales: { x: { time: false } },
        axes: [axis("", 26), axis(`${about.name} (${about.unit})`, 58)],
        series: [{ label: "time (s)", value: (u, v) => short(v) }, line("measured", "--ink", 1.2),
          line("as believed", "--before", 1.2), ...plain(1.2, { dash: [2, 3] }),
          line("improved", "--after", 1.2, { dash: [6, 3] })],
        hooks: { drawClear: [behind(0, windows)], ...together },
      }, [when, read, less(before), ...without.map(less), less(after)]);
    }
    put("time", {
      cursor: { drag: { x: true, y: false }, sync: { key: "time" } },
      scales: { x: { time: false } },
      axes: [axis("time (s)", 38), axis(`error (${about.unit})`, 58)],
      series: [{ label: "time (s)", value: (u, v) => short(v) }, line("as believed", "--before", 1),
        ...plain(1), line("improved", "--after", 1)],
      hooks: { drawClear: [behind(about.noise ? 2 * about.noise : 0, windows)], ...together },
    }, [when, before, ...without, after]);
    if (chosen.shown) {
      // Once both figures have scaled themselves, which they do after this.
      const [min, max] = chosen.shown;
      setTimeout(() => plots.time.setScale("x", { min, max }));
      chosen.shown = null;
    }
    const thin = data.every > 1 ? ` Every ${data.every}th row is shown.` : "";
    const kind = data.runs[chosen.run].held_out ? "held out" : "fitted";
    el("time-caption").textContent =
      `${t.measured ? "Above, measured and simulated; below, measured minus simulated" : "Measured minus simulated"} ` +
      `${about.name} in ${chosen.run} (${kind}). Grey: two sigma of the sensors' noise` +
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

  function draw() { drawTime(); drawRegime(); drawCorrelation(); if (replay) replay.show(); }

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

  // Replay: the vehicle from a camera that can be turned, drawn from quaternions (scalar first, body to world, z down).
  const replay = data.replay && el("replay") && (() => {
    const r = data.replay, canvas = el("replay"), when = times(r.time);
    const rows = (name, width) => {
      if (!r[name]) return null;
      const flat = series(r[name]), out = [];
      for (let i = 0; i < flat.length; i += width) out.push(flat.slice(i, i + width));
      return out;
    };
    const attitude = { recorded: rows("recorded", 4), before: rows("before", 4), after: rows("after", 4) };
    const reach = Math.max(...r.rotors.map((p) => Math.hypot(p[0], p[1])));
    const rotors = r.rotors.map((p) => [p[0] / reach, p[1] / reach, 0]);
    const camera = { turn: -0.7, lift: 0.45 };
    let frame = 0, timer = 0, arrows = "force";
    const turned = (q, v) => {
      const [w, x, y, z] = q, [a, b, c] = v;
      return [(1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c,
        2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c,
        2 * (x * z - w * y) * a + 2 * (y * z + w * x) * b + (1 - 2 * (x * x + y * y)) * c];
    };
    const between = (p, q) => {
      const dot = Math.abs(p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]);
      return (2 * Math.acos(Math.min(dot, 1)) * 180) / Math.PI;
    };
    const largest = (group) => {
      const all = rows(`${group}_before`, 3);
      if (!all) return 0;
      const sizes = all.map((v) => Math.hypot(...v)).sort((a, b) => a - b);
      return sizes[Math.floor(0.98 * (sizes.length - 1))];
    };
    const full = { force: largest("force"), moment: largest("moment") };
    const unit = { force: "N", moment: "N m" };
    for (const option of [...el("arrows").options]) if (!full[option.value]) option.remove();
    if (el("arrows").options.length) arrows = el("arrows").value;

    function show() {
      const dpr = window.devicePixelRatio || 1, wide = canvas.clientWidth, tall = canvas.clientHeight;
      canvas.width = wide * dpr; canvas.height = tall * dpr;
      const g = canvas.getContext("2d");
      g.scale(dpr, dpr);
      g.clearRect(0, 0, wide, tall);
      const unitPx = Math.min(wide, tall) * 0.27, ct = Math.cos(camera.turn), st = Math.sin(camera.turn),
        cl = Math.cos(camera.lift), sl = Math.sin(camera.lift);
      const seen = ([n, e, d], cx = wide / 2, cy = tall / 2, size = unitPx) => {
        const right = n * st + e * ct, away = n * ct - e * st;
        return [cx + size * right, cy + size * (d * cl - away * sl)];
      };
      const path = (points, colour, width, dash = []) => {
        g.strokeStyle = css(colour); g.lineWidth = width; g.setLineDash(dash); g.beginPath();
        points.forEach((p, i) => (i ? g.lineTo(...p) : g.moveTo(...p)));
        g.stroke(); g.setLineDash([]);
      };
      const pointed = (from, to, colour, width) => {
        path([from, to], colour, width);
        const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
        if (Math.hypot(to[0] - from[0], to[1] - from[1]) < 4) return;
        path([-0.4, 0.4].map((a) => [to[0] - 9 * Math.cos(angle + a), to[1] - 9 * Math.sin(angle + a)]).toSpliced(1, 0, to),
          colour, width);
      };
      g.font = "12px system-ui"; g.fillStyle = css("--soft");
      for (const [axis, name] of [[[1, 0, 0], "north"], [[0, 1, 0], "east"], [[0, 0, 1], "down"]]) {
        const tip = seen(axis, 62, tall - 58, 34);
        pointed(seen([0, 0, 0], 62, tall - 58, 34), tip, "--soft", 1);
        g.fillText(name, tip[0] < 62 ? tip[0] - 4 - g.measureText(name).width : tip[0] + 4, tip[1] + 4);
      }
      for (const [name, colour, width, dash] of [["before", "--before", 1.5, [5, 4]], ["after", "--after", 1.5, []],
        ["recorded", "--ink", 2.6, []]]) {
        const q = attitude[name][frame];
        for (const [i, hub] of rotors.entries()) {
          path([seen([0, 0, 0]), seen(turned(q, hub))], colour, width, dash);
          const ring = [];
          for (let k = 0; k <= 24; k++) {
            const a = (2 * Math.PI * k) / 24;
            ring.push(seen(turned(q, [hub[0] + 0.36 * Math.cos(a), hub[1] + 0.36 * Math.sin(a), -0.05])));
          }
          path(ring, colour, hub[0] > 0 && name === "recorded" ? 2.6 : 1, dash);
          if (name === "recorded") {
            const place = seen(turned(q, hub.map((v) => 1.5 * v)));
            g.fillStyle = css("--soft"); g.fillText(String(i + 1), place[0] - 3, place[1] + 4);
          }
        }
      }
      const said = [];
      for (const [stage, colour, words] of [["before", "--before", "believed"], ["after", "--after", "improved"]]) {
        const left = rows(`${arrows}_${stage}`, 3);
        if (left && full[arrows]) {
          const v = left[frame].map((x) => (1.5 * x) / full[arrows]);
          pointed(seen([0, 0, 0]), seen(turned(attitude.recorded[frame], v)), colour, 3);
          said.push(`${words}: attitude off by ${short(between(attitude.recorded[frame], attitude[stage][frame]))}°, ` +
            `${arrows} by ${short(Math.hypot(...left[frame]))} ${unit[arrows]}`);
        } else said.push(`${words}: attitude off by ${short(between(attitude.recorded[frame], attitude[stage][frame]))}°`);
      }
      el("frame").setAttribute("aria-valuetext", `${when[frame].toFixed(2)} s`);
      el("replay-caption").textContent = `${r.run} at ${when[frame].toFixed(2)} s. ` + said.join("; ") +
        ". Black: recorded; orange, dashed: simulated as believed; blue: improved, both restarted from the recording every half second. " +
        (full[arrows] ? `Thick arrows: the ${arrows} that each leaves unexplained, ${short(full[arrows] / 1.5)} ${unit[arrows]} to an arm's length. ` : "") +
        "Front rotors are drawn thicker.";
    }
    function go(to) { frame = (to + when.length) % when.length; el("frame").value = frame; show(); }
    function play(on) {
      clearInterval(timer); timer = 0;
      el("play").textContent = on ? "pause" : "play"; el("play").setAttribute("aria-pressed", String(on));
      const period = when.length > 1 ? (1000 * (when[when.length - 1] - when[0])) / (when.length - 1) : 40;
      if (on) timer = setInterval(() => go(frame + 1), period);
    }
    el("frame").max = when.length - 1;
    // It opens where most is left unexplained.
    const first = rows(`${arrows}_before`, 3);
    if (first) {
      const sizes = first.map((v) => Math.hypot(...v));
      frame = sizes.indexOf(Math.max(...sizes));
    }
    el("frame").value = frame;
    el("frame").addEventListener("input", (e) => go(Number(e.target.value)));
    el("play").addEventListener("click", () => play(!timer));
    el("arrows").addEventListener("change", (e) => { arrows = e.target.value; show(); });
    canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
    canvas.addEventListener("pointermove", (e) => {
      if (!e.buttons) return;
      camera.turn += e.movementX / 120;
      camera.lift = Math.min(1.5, Math.max(-0.2, camera.lift + e.movementY / 120));
      show();
    });
    canvas.addEventListener("keydown", (e) => {
      const turn = { ArrowLeft: -0.15, ArrowRight: 0.15 }[e.key], lift = { ArrowUp: 0.1, ArrowDown: -0.1 }[e.key];
      if (e.key === " ") play(!timer);
      else if (turn) camera.turn += turn;
      else if (lift) camera.lift = Math.min(1.5, Math.max(-0.2, camera.lift + lift));
      else return;
      e.preventDefault();
      show();
    });
    return { show };
  })();

  let waiting = 0;
  let drawn = document.body.clientWidth;
  new ResizeObserver(() => {
    if (document.body.clientWidth === drawn) return;
    clearTimeout(waiting);
    waiting = setTimeout(() => { drawn = document.body.clientWidth; draw(); }, 60);
  }).observe(document.body);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
