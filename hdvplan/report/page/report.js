"use strict";
// Every plan has a panel: a map and diagrams that share one cursor (an index into the samples). Plans of one road share cursor and view.
(() => {
  const MISSING = -32768, CHUNK = 64, NEAR_PX = 60, SPECK = 1.5, CHARTS = { left: 62, right: 12, gap: 16, bottom: 30 };
  // On A4 within its margins, a canvas is 702 pixels of the page wide. Chromium prints what was drawn on it as vectors, in sixty-fourths of
  // its size: ratio 4 and this width are printed as they are.
  const ON_PAPER = { ratio: 4, width: 700, plane: 390, profiles: 380 };
  let printing = false;
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  function decode(column, count) {
    const text = atob(column.data), bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer), values = new Float64Array(count);
    for (let i = 0; i < count; i++) {
      if (column.scale === undefined) values[i] = view.getFloat32(4 * i, true);
      else {
        const whole = view.getInt16(2 * i, true);
        values[i] = whole === MISSING ? NaN : whole * column.scale;
      }
    }
    return values;
  }

  const panels = JSON.parse(document.getElementById("data").textContent).map((plan, number) => {
    const at = {};
    for (const name in plan.columns) at[name] = decode(plan.columns[name], plan.count);
    const root = document.querySelector(`.plan[data-plan="${number}"]`);
    const panel = { plan, at, root, cursor: 0, view: null, range: [0, (plan.count - 1) * plan.spacing], chunks: [],
      map: root.querySelector(".plane"), charts: root.querySelector(".profiles"), readout: root.querySelector(".readout"),
      slider: root.querySelector(".along"), key: `${plan.road}/${plan.count}/${plan.origin}` };
    panel.cos = at.heading.map(Math.cos);
    panel.sin = at.heading.map(Math.sin);
    panel.left = furthest(panel, "left", Math.max);
    panel.right = furthest(panel, "right", Math.min);
    const room = 1 + Math.max(...extremes(panel.left), ...extremes(panel.right).map(Math.abs));
    for (let begin = 0; begin < plan.count - 1; begin += CHUNK) {
      const end = Math.min(begin + CHUNK, plan.count - 1);
      const x = extremes(at.x.subarray(begin, end + 1)), y = extremes(at.y.subarray(begin, end + 1));
      panel.chunks.push({ begin, end, box: [x[0] - room, x[1] + room, y[0] - room, y[1] + room] });
    }
    panel.breaches = broken(panel);
    panel.slider.max = plan.count - 1;
    return panel;
  });

  function furthest(panel, side, pick) {
    const all = panel.plan.bodies.map((_, unit) => panel.at[side + (unit + 1)]);
    return all[0].map((_, i) => all.reduce((most, one) => (isNaN(one[i]) ? most : isNaN(most) ? one[i] : pick(most, one[i])), NaN));
  }

  function extremes(values) {
    let low = Infinity, high = -Infinity;
    for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
    return [low, high];
  }

  // Broken limits, deepest first, as samples and the limit that is broken; limits of overhangs exist only where they differ.
  function broken(panel) {
    const { at, plan } = panel, sample = (s) => clamp(Math.round(s / plan.spacing), 0, plan.count - 1);
    return [...plan.breaches].sort((a, b) => b.depth_m - a.depth_m).map((breach) => {
      const own = `${breach.side}_limit`, wide = `${breach.side}_sweep_limit`, run = [], wheels = breach.region === "drivable" && Boolean(at[wide]);
      for (let i = sample(breach.s_from); i <= Math.max(sample(breach.s_to), sample(breach.s_from)); i++) run.push(i);
      return { side: breach.side, sign: breach.side === "left" ? 1 : -1, limit: (breach.region === "sweepable" && at[wide]) || at[own], wheels, run,
        deepest: sample(breach.s_deepest), depth: breach.depth_m, x: breach.x, y: breach.y };
    });
  }

  // How far the bodies reach beyond a broken limit, or nothing where it binds only wheels.
  function reachBeyond(panel, { wheels, sign, limit }) {
    return wheels ? null : (i) => (sign > 0 ? Math.max(panel.left[i], limit[i]) : Math.min(panel.right[i], limit[i]));
  }

  const place = (panel, i, offset) => [panel.at.x[i] - offset * panel.sin[i], panel.at.y[i] + offset * panel.cos[i]];

  // Axle and direction of every body when the lead rear axle is at sample i.
  function poses(panel, i) {
    let heading = panel.at.heading[i] + panel.at.e_psi[i], [x, y] = place(panel, i, panel.at.e_y[i]);
    return panel.plan.bodies.map((body, unit) => {
      if (unit > 0) {
        const ahead = panel.plan.bodies[unit - 1];
        x -= ahead.hitch_offset_m * Math.cos(heading);
        y -= ahead.hitch_offset_m * Math.sin(heading);
        heading -= panel.at["beta" + unit][i];
        x -= body.wheelbase_m * Math.cos(heading);
        y -= body.wheelbase_m * Math.sin(heading);
      }
      return { x, y, c: Math.cos(heading), s: Math.sin(heading) };
    });
  }

  // The corners of every body.
  function bodies(panel, i) {
    return poses(panel, i).map(({ x, y, c, s }, unit) => {
      const body = panel.plan.bodies[unit], half = body.width_m / 2;
      return [[body.front_m, half], [body.front_m, -half], [-body.rear_m, -half], [-body.rear_m, half]]
        .map(([u, v]) => [x + u * c - v * s, y + u * s + v * c]);
    });
  }

  // The sides of a canvas in pixels of the page: as laid out, or as on paper, where the layout is another one than on the screen.
  function sides(canvas) {
    if (!printing) return { ratio: window.devicePixelRatio || 1, width: canvas.clientWidth, height: canvas.clientHeight };
    return { ratio: ON_PAPER.ratio, width: ON_PAPER.width, height: canvas.classList.contains("plane") ? ON_PAPER.plane : ON_PAPER.profiles };
  }

  function sized(canvas) {
    const { ratio, width, height } = sides(canvas);
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return { pen, width, height };
  }

  // ---- map
  function fit(panel) {
    const x = extremes(panel.at.x), y = extremes(panel.at.y), room = 12 + 0.03 * Math.max(x[1] - x[0], y[1] - y[0]);
    const scale = Math.min(panel.map.clientWidth / (x[1] - x[0] + 2 * room), panel.map.clientHeight / (y[1] - y[0] + 2 * room));
    return { x: (x[0] + x[1]) / 2, y: (y[0] + y[1]) / 2, scale };
  }

  function drawMap(panel) {
    const { pen, width, height } = sized(panel.map), { at, plan } = panel;
    if (!width || !panel.map.clientWidth) return;
    panel.view ??= fit(panel);
    const shrunk = printing ? Math.min(width / panel.map.clientWidth, height / panel.map.clientHeight) : 1; // the same stretch, all of it
    const view = { ...panel.view, scale: panel.view.scale * shrunk }, px = (x) => width / 2 + (x - view.x) * view.scale, py = (y) => height / 2 - (y - view.y) * view.scale;
    const seen = panel.chunks.filter(({ box }) => px(box[1]) > 0 && px(box[0]) < width && py(box[2]) > 0 && py(box[3]) < height);
    const stride = Math.max(1, Math.floor(1 / (plan.spacing * view.scale)));
    const along = (begin, end) => {
      const places = [];
      for (let i = begin; i < end; i += stride) places.push(i);
      places.push(end);
      return places;
    };
    const trace = (points) => points.forEach(([x, y], k) => (k ? pen.lineTo(px(x), py(y)) : pen.moveTo(px(x), py(y))));
    for (let unit = plan.bodies.length - 1; unit >= 0; unit--) {
      pen.fillStyle = pen.strokeStyle = css(`--fill${unit % 4}`);
      pen.lineWidth = 0.7;
      for (const { begin, end } of seen) {
        const left = at[`left${unit + 1}`], right = at[`right${unit + 1}`], run = along(begin, end).filter((i) => !isNaN(left[i]));
        if (run.length < 2) continue;
        pen.beginPath();
        trace([...run.map((i) => place(panel, i, left[i])), ...run.reverse().map((i) => place(panel, i, right[i]))]);
        pen.closePath();
        pen.fill();
        pen.stroke(); // closes the seams between chunks
      }
    }
    pen.strokeStyle = css("--muted");
    pen.lineWidth = view.scale > 1 ? 1 : 2;
    pen.setLineDash(view.scale > 1 ? [8, 5] : []);
    for (const { begin, end } of seen) {
      pen.beginPath();
      trace(along(begin, end).map((i) => place(panel, i, 0)));
      pen.stroke();
    }
    pen.setLineDash([]);
    for (const { region, rings } of plan.regions) {
      pen.beginPath();
      for (const ring of rings) { trace(ring); pen.closePath(); }
      if (region === "obstacle") {
        pen.fillStyle = css("--muted");
        pen.globalAlpha = 0.6;
        pen.fill("evenodd");
        pen.globalAlpha = 1;
      } else hatch(pen, width, height);
    }
    for (const { layer, binds, bridged, lines } of view.scale > 0.3 ? plan.limits : []) {
      const beyond = layer === "conflicts";
      pen.strokeStyle = pen.fillStyle = css(beyond ? "--bad" : "--ink");
      pen.lineWidth = 1.4;
      pen.setLineDash(bridged ? [8, 6] : binds === "overhangs" ? [2, 3] : []);
      pen.beginPath();
      lines.forEach(trace);
      if (beyond) pen.fill("evenodd");
      pen.stroke();
    }
    pen.setLineDash([]);
    if (view.scale > 1.5) {
      const long = plan.bodies.reduce((sum, body) => sum + body.front_m + body.rear_m, 0);
      const apart = Math.ceil((1.2 * long) / plan.spacing);
      for (let i = apart; i < plan.count; i += apart) if (seen.some(({ begin, end }) => begin <= i && i <= end)) drawBodies(panel, i, pen, px, py, 0.45);
    }
    pen.font = "12px system-ui, sans-serif";
    const written = [];
    pen.fillStyle = css("--bad");
    for (const breach of panel.breaches) {
      const { side, sign, deepest, depth } = breach, out = (sign * 10) / view.scale;
      const x = breach.x - out * panel.sin[deepest], y = breach.y + out * panel.cos[deepest];
      if (view.scale < 1.5) { pen.beginPath(); pen.arc(px(x), py(y), 4, 0, 7); pen.fill(); }
      else if (!written.some((other) => other.side === side && Math.abs(other.deepest - deepest) * plan.spacing < 8)) {
        pen.textAlign = sign * panel.sin[deepest] > 0 ? "right" : "left";
        write(pen, `${depth.toFixed(2)} m`, px(x), py(y) + 4);
        written.push(breach);
      }
    }
    if (view.scale > 2) drawTracks(panel, seen, pen, px, py);
    drawDirection(panel, seen, view, pen, px, py);
    pen.fillStyle = css("--ink");
    pen.beginPath();
    pen.arc(px(at.x[0]), py(at.y[0]), 4, 0, 7);
    pen.fill();
    pen.textAlign = "left";
    write(pen, "start", px(at.x[0]) + 7, py(at.y[0]) - 6);
    drawBodies(panel, panel.cursor, pen, px, py, 1);
    if (view.scale < 1.5) { // bodies are specks: a ring says where they are
      pen.strokeStyle = css("--accent");
      pen.lineWidth = 2.5;
      pen.beginPath();
      pen.arc(px(at.x[panel.cursor]), py(at.y[panel.cursor]), 8, 0, 7);
      pen.stroke();
    }
    drawScale(pen, view.scale, height);
    if (plan.north) drawNorth(pen, height);
    if (view.scale > 2 * fit(panel).scale * shrunk) drawWhole(panel, view, pen, width, height);
  }

  // Where the outer wheels rolled, over the samples that are seen.
  function write(pen, text, x, y) { // on a pale edge of its own, as lines pass below it
    pen.save();
    pen.strokeStyle = css("--panel");
    pen.lineWidth = 3.5;
    pen.lineJoin = "round";
    pen.strokeText(text, x, y);
    pen.restore();
    pen.fillText(text, x, y);
  }

  function drawTracks(panel, seen, pen, px, py) {
    pen.setLineDash([6, 3]);
    pen.lineWidth = 0.9;
    for (const [unit, ahead, left] of panel.plan.wheels) {
      pen.strokeStyle = css(`--body${unit % 4}`);
      for (const { begin, end } of seen) {
        pen.beginPath();
        for (let i = begin; i <= end; i++) {
          const { x, y, c, s } = poses(panel, i)[unit];
          pen.lineTo(px(x + ahead * c - left * s), py(y + ahead * s + left * c));
        }
        pen.stroke();
      }
    }
    pen.setLineDash([]);
  }

  // Arrow heads on the road's centre, some 150 pixels apart.
  function drawDirection(panel, seen, view, pen, px, py) {
    const { at, plan } = panel, every = Math.max(1, Math.round(150 / (plan.spacing * view.scale)));
    pen.fillStyle = css("--ink");
    for (const { begin, end } of seen) {
      for (let i = Math.ceil(begin / every) * every; i < end; i += every) {
        if (!i) continue;
        const x = px(at.x[i]), y = py(at.y[i]), c = panel.cos[i], s = -panel.sin[i];
        pen.beginPath();
        for (const [u, v] of [[7, 0], [-5, 5], [-5, -5]]) pen.lineTo(x + u * c - v * s, y + u * s + v * c);
        pen.fill();
      }
    }
  }

  function drawNorth(pen, height) {
    const x = 22, y = height - 62;
    pen.strokeStyle = pen.fillStyle = css("--ink");
    pen.lineWidth = 1.5;
    pen.beginPath(); pen.moveTo(x, y + 16); pen.lineTo(x, y - 6); pen.stroke();
    pen.beginPath(); pen.moveTo(x, y - 12); pen.lineTo(x - 4, y - 2); pen.lineTo(x + 4, y - 2); pen.fill();
    pen.textAlign = "center";
    pen.fillText("N", x, y + 29);
    pen.textAlign = "left";
  }

  // The whole road in the lower right corner of an enlarged map, with what the map shows.
  function drawWhole(panel, view, pen, width, height) {
    const { at, plan } = panel, x = extremes(at.x), y = extremes(at.y), side = Math.min(120, 0.3 * width, 0.3 * height);
    const scale = side / Math.max(x[1] - x[0], y[1] - y[0], 1), left = width - 14 - (x[1] - x[0]) * scale, base = height - 14;
    const qx = (value) => left + (value - x[0]) * scale, qy = (value) => base - (value - y[0]) * scale;
    const [w, h] = [(x[1] - x[0]) * scale, (y[1] - y[0]) * scale];
    pen.fillStyle = css("--paper");
    pen.globalAlpha = 0.85;
    pen.fillRect(left - 8, base - h - 8, w + 16, h + 16);
    pen.globalAlpha = 1;
    pen.strokeStyle = css("--muted");
    pen.lineWidth = 1.2;
    pen.beginPath();
    for (let i = 0; i < plan.count; i += Math.max(1, Math.floor(plan.count / 400))) pen.lineTo(qx(at.x[i]), qy(at.y[i]));
    pen.stroke();
    const half = Math.max(4, (0.5 * width * scale) / view.scale);
    pen.strokeStyle = css("--accent");
    pen.lineWidth = 2;
    pen.strokeRect(qx(view.x) - half, qy(view.y) - (half * height) / width, 2 * half, (2 * half * height) / width);
  }

  // Hatch the current path: with lines, as patterns are lost in print.
  function hatch(pen, width, height) {
    pen.save();
    pen.clip("evenodd");
    pen.strokeStyle = css("--muted");
    pen.lineWidth = 1;
    pen.beginPath();
    for (let x = -height; x < width; x += 6) { pen.moveTo(x, height); pen.lineTo(x + height, 0); }
    pen.stroke();
    pen.restore();
  }

  function drawBodies(panel, i, pen, px, py, strength) {
    pen.globalAlpha = strength;
    bodies(panel, i).forEach((corners, unit) => {
      pen.beginPath();
      corners.forEach(([x, y], k) => (k ? pen.lineTo(px(x), py(y)) : pen.moveTo(px(x), py(y))));
      pen.closePath();
      pen.fillStyle = css("--hull");
      pen.strokeStyle = css(`--body${unit % 4}`);
      pen.lineWidth = strength === 1 ? 2.4 : 1.2;
      pen.fill();
      pen.stroke();
    });
    pen.globalAlpha = 1;
  }

  const round = (value) => { const ten = 10 ** Math.floor(Math.log10(value)), part = value / ten; return ten * (part >= 5 ? 5 : part >= 2 ? 2 : 1); };

  function drawScale(pen, scale, height) {
    const metres = round(120 / scale), long = metres * scale;
    pen.strokeStyle = pen.fillStyle = css("--ink");
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(14, height - 18); pen.lineTo(14, height - 12); pen.lineTo(14 + long, height - 12); pen.lineTo(14 + long, height - 18);
    pen.stroke();
    pen.fillText(metres >= 1000 ? `${metres / 1000} km` : `${metres} m`, 20 + long, height - 11);
  }

  // ---- diagrams over s
  function curves(panel) {
    const { at, plan } = panel, solid = [], dotted = [], degrees = 180 / Math.PI;
    plan.bodies.forEach((_, unit) => { if (unit) { solid.push([at["beta" + unit], `--body${unit % 4}`, degrees]); dotted.push([at["expected_beta" + unit], degrees]); } });
    const charts = [{ name: "reach [m]", share: 1.6, reach: true },
      { name: "curvature [1/m]", share: 1, solid: [[at.road_curvature, "--muted", 1], [at.kappa, "--body0", 1]], dotted: [[at.expected_curvature, 1]] }];
    if (solid.length) charts.push({ name: "articulation [deg]", share: 1, solid, dotted });
    return charts;
  }

  function drawCharts(panel) {
    const { pen, width, height } = sized(panel.charts), { at, plan } = panel;
    if (!width) return;
    const charts = curves(panel), shares = charts.reduce((sum, chart) => sum + chart.share, 0), { left, right, gap, bottom } = CHARTS;
    const whole = height - bottom - gap * charts.length, [from, to] = panel.range;
    const sx = (s) => left + ((s - from) / (to - from)) * (width - left - right);
    const first = clamp(Math.floor(from / plan.spacing) - 1, 0, plan.count - 1), last = clamp(Math.ceil(to / plan.spacing) + 1, 0, plan.count - 1);
    const stride = Math.max(1, Math.floor((last - first) / (6 * width)));
    const run = [];
    for (let i = first; i <= last; i += stride) run.push(i);
    pen.font = "11px system-ui, sans-serif";
    let top = gap;
    for (const chart of charts) {
      const high = (whole * chart.share) / shares, series = [];
      if (chart.reach) {
        series.push(run.map((i) => panel.left[i]), run.map((i) => panel.right[i]), run.map((i) => at.expected_left[i]), run.map((i) => at.expected_right[i]));
        const seen = 2 * Math.max(...series.map((one) => Math.max(...extremes(one).map(Math.abs))));
        for (const name of ["left_limit", "right_limit", "left_sweep_limit", "right_sweep_limit"]) if (at[name]) series.push(run.map((i) => (Math.abs(at[name][i]) < seen ? at[name][i] : NaN)));
      } else {
        for (const [values, , factor] of chart.solid) series.push(run.map((i) => values[i] * factor));
        for (const [values, factor] of chart.dotted) if (values) series.push(run.map((i) => values[i] * factor));
      }
      let [low, most] = series.reduce(([a, b], one) => { const [c, d] = extremes(one); return [Math.min(a, c), Math.max(b, d)]; }, [Infinity, -Infinity]);
      const margin = 0.06 * (most - low) || 1;
      low -= margin;
      most += margin;
      const y = (value) => top + high * (1 - (value - low) / (most - low));
      pen.textAlign = "right";
      pen.lineWidth = 1;
      const step = round((most - low) / 3);
      for (let value = Math.ceil(low / step) * step; value <= most; value += step) {
        pen.strokeStyle = css("--grid");
        pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width - right, y(value)); pen.stroke();
        pen.fillStyle = css("--muted");
        pen.fillText(String(+value.toFixed(6)), left - 6, y(value) + 4);
      }
      pen.textAlign = "left";
      pen.fillStyle = css("--ink");
      pen.fillText(chart.name, left + 4, top - 4);
      pen.save();
      pen.beginPath(); pen.rect(left, top, width - left - right, high); pen.clip();
      const draw = (value, colour, thick, dash) => {
        pen.strokeStyle = css(colour); pen.lineWidth = thick; pen.setLineDash(dash || []);
        pen.beginPath();
        let open = false;
        for (const i of run) {
          const v = value(i);
          if (isNaN(v)) { open = false; continue; }
          if (open) pen.lineTo(sx(i * plan.spacing), y(v)); else pen.moveTo(sx(i * plan.spacing), y(v));
          open = true;
        }
        pen.stroke(); pen.setLineDash([]);
      };
      if (chart.reach) {
        for (let unit = plan.bodies.length - 1; unit >= 0; unit--) {
          const a = at[`left${unit + 1}`], b = at[`right${unit + 1}`], there = run.filter((i) => !isNaN(a[i]));
          pen.fillStyle = css(`--fill${unit % 4}`);
          pen.beginPath();
          there.forEach((i) => pen.lineTo(sx(i * plan.spacing), y(a[i])));
          there.reverse().forEach((i) => pen.lineTo(sx(i * plan.spacing), y(b[i])));
          pen.fill();
        }
        plan.bodies.forEach((_, unit) => ["left", "right"].forEach((side) => draw((i) => at[side + (unit + 1)][i], `--body${unit % 4}`, 1)));
        draw((i) => at.expected_left[i], "--ink", 1.2, [2, 2]);
        draw((i) => at.expected_right[i], "--ink", 1.2, [2, 2]);
        for (const side of ["left", "right"]) {
          if (at[`${side}_limit`]) draw((i) => at[`${side}_limit`][i], "--ink", 1.4);
          if (at[`${side}_sweep_limit`]) draw((i) => at[`${side}_sweep_limit`][i], "--ink", 1.2, [2, 4]);
        }
        pen.fillStyle = css("--bad");
        for (const breach of panel.breaches) {
          const { limit, run: there, deepest, sign, depth } = breach, outside = reachBeyond(panel, breach);
          pen.beginPath();
          if (outside) {
            there.forEach((i) => pen.lineTo(sx(i * plan.spacing), y(limit[i])));
            [...there].reverse().forEach((i) => pen.lineTo(sx(i * plan.spacing), y(outside(i))));
            pen.fill();
          }
          const x = sx(deepest * plan.spacing), tip = y(limit[deepest] + sign * depth); // a stretch may be too short to see
          pen.beginPath(); pen.moveTo(x, tip); pen.lineTo(x - 4, tip - sign * 7); pen.lineTo(x + 4, tip - sign * 7); pen.fill();
        }
      } else {
        for (const [values, colour, factor] of chart.solid) draw((i) => values[i] * factor, colour, 1.5);
        for (const [values, factor] of chart.dotted) if (values) draw((i) => values[i] * factor, "--ink", 1.2, [2, 2]);
      }
      pen.restore();
      top += high + gap;
    }
    pen.fillStyle = css("--muted");
    pen.textAlign = "center";
    const step = round((to - from) / 5);
    for (let s = Math.ceil(from / step) * step; s <= to; s += step) pen.fillText(String(+s.toFixed(2)), sx(s), height - 16);
    pen.fillText("arclength s [m]", (left + width - right) / 2, height - 3);
    pen.strokeStyle = css("--accent");
    pen.lineWidth = 1.5;
    const now = sx(panel.cursor * plan.spacing);
    if (now >= left && now <= width - right) { pen.beginPath(); pen.moveTo(now, gap); pen.lineTo(now, height - bottom); pen.stroke(); }
  }

  // ---- reading and moving
  function readout(panel) {
    const { at, plan, cursor: i } = panel, words = [`s = ${(i * plan.spacing).toFixed(1)} m`];
    if (at.clearance) words.push(`clearance ${at.clearance[i].toFixed(2)} m`);
    words.push(`left ${panel.left[i].toFixed(2)} m`, `right ${(-panel.right[i]).toFixed(2)} m`, `curvature ${at.kappa[i].toFixed(4)} 1/m`);
    const bends = plan.bodies.slice(1).map((_, k) => `${((at["beta" + (k + 1)][i] * 180) / Math.PI).toFixed(1)}°`);
    if (bends.length) words.push(`articulation ${bends.join(", ")}`);
    panel.readout.textContent = words.join("  ·  ");
    panel.readout.classList.toggle("bad", Boolean(at.clearance) && at.clearance[i] < -0.01);
    panel.slider.value = i;
  }

  const waiting = new Set();
  function redraw(panel) {
    if (waiting.has(panel)) return;
    waiting.add(panel);
    requestAnimationFrame(() => { waiting.delete(panel); drawMap(panel); drawCharts(panel); readout(panel); });
  }

  const twins = (panel) => panels.filter((other) => other.key === panel.key);

  function moveTo(panel, i) {
    for (const twin of twins(panel)) { twin.cursor = clamp(Math.round(i), 0, twin.plan.count - 1); redraw(twin); }
  }

  function look(panel, view) {
    for (const twin of twins(panel)) { twin.view = { ...view }; redraw(twin); }
  }

  function zoom(panel, factor, x = panel.map.clientWidth / 2, y = panel.map.clientHeight / 2) {
    const view = panel.view, scale = clamp(view.scale * factor, fit(panel).scale / 2, 400);
    const dx = x - panel.map.clientWidth / 2, dy = panel.map.clientHeight / 2 - y;
    look(panel, { x: view.x + dx / view.scale - dx / scale, y: view.y + dy / view.scale - dy / scale, scale });
  }

  function visit(panel, s) {
    const i = clamp(Math.round(s / panel.plan.spacing), 0, panel.plan.count - 1);
    moveTo(panel, i);
    look(panel, { x: panel.at.x[i], y: panel.at.y[i], scale: Math.min(panel.map.clientWidth, panel.map.clientHeight) / 60 });
    span(panel, [s - 60, s + 60]);
    panel.map.scrollIntoView({ block: "nearest" });
  }

  function span(panel, [from, to]) {
    const whole = (panel.plan.count - 1) * panel.plan.spacing, long = clamp(to - from, 10 * panel.plan.spacing, whole);
    const begin = clamp(from, 0, whole - long);
    for (const twin of twins(panel)) { twin.range = [begin, begin + long]; redraw(twin); }
  }

  function nearest(panel, event) {
    const box = panel.map.getBoundingClientRect(), view = panel.view;
    const x = view.x + (event.clientX - box.left - panel.map.clientWidth / 2) / view.scale;
    const y = view.y - (event.clientY - box.top - panel.map.clientHeight / 2) / view.scale;
    let best = -1, least = Math.max((NEAR_PX / view.scale) ** 2, 100);
    for (let i = 0; i < panel.plan.count; i++) {
      const far = (panel.at.x[i] - x) ** 2 + (panel.at.y[i] - y) ** 2;
      if (far < least) { least = far; best = i; }
    }
    return best;
  }

  function sampleAt(panel, event) {
    const box = panel.charts.getBoundingClientRect(), [from, to] = panel.range;
    return from + ((event.clientX - box.left - CHARTS.left) / (panel.charts.clientWidth - CHARTS.left - CHARTS.right)) * (to - from);
  }

  function drag(canvas, start, move, hover) {
    let held = null;
    canvas.addEventListener("pointerdown", (event) => { held = { x: event.clientX, y: event.clientY, state: start() }; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => (held ? move(held.state, event.clientX - held.x, event.clientY - held.y) : hover(event)));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
  }

  function play(panel, button) {
    if (panel.playing) { panel.playing = false; return; }
    panel.playing = true;
    button.textContent = "❚❚";
    let before = null, s = panel.cursor >= panel.plan.count - 1 ? 0 : panel.cursor * panel.plan.spacing;
    const tick = (now) => {
      s += before === null ? 0 : (now - before) * 0.012; // 12 m of road a second
      before = now;
      const i = s / panel.plan.spacing;
      moveTo(panel, i);
      if (panel.view.scale > 2 * fit(panel).scale) look(panel, { ...panel.view, x: panel.at.x[panel.cursor], y: panel.at.y[panel.cursor] });
      if (i >= panel.plan.count - 1) panel.playing = false;
      if (panel.playing) requestAnimationFrame(tick);
      else button.textContent = "▶";
    };
    requestAnimationFrame(tick);
  }

  for (const panel of panels) {
    drag(panel.map, () => panel.view, (view, dx, dy) => look(panel, { ...view, x: view.x - dx / view.scale, y: view.y + dy / view.scale }),
      (event) => { const i = nearest(panel, event); if (i >= 0) moveTo(panel, i); });
    panel.map.addEventListener("wheel", (event) => {
      event.preventDefault();
      const box = panel.map.getBoundingClientRect();
      zoom(panel, Math.exp(-0.0015 * event.deltaY), event.clientX - box.left, event.clientY - box.top);
    }, { passive: false });
    panel.map.addEventListener("keydown", (event) => {
      const by = 60 / panel.view.scale, move = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, by], ArrowDown: [0, -by] }[event.key];
      if (move) look(panel, { ...panel.view, x: panel.view.x + move[0], y: panel.view.y + move[1] });
      else if (event.key === "+" || event.key === "=") zoom(panel, 1.4);
      else if (event.key === "-") zoom(panel, 1 / 1.4);
      else if (event.key === "0") look(panel, fit(panel));
      else return;
      event.preventDefault();
    });
    drag(panel.charts, () => panel.range, ([from, to], dx) => {
      const by = (dx / (panel.charts.clientWidth - CHARTS.left - CHARTS.right)) * (to - from);
      span(panel, [from - by, to - by]);
    }, (event) => moveTo(panel, sampleAt(panel, event) / panel.plan.spacing));
    panel.charts.addEventListener("wheel", (event) => {
      event.preventDefault();
      const [from, to] = panel.range, s = sampleAt(panel, event), factor = Math.exp(0.0015 * event.deltaY);
      span(panel, [s - (s - from) * factor, s + (to - s) * factor]);
    }, { passive: false });
    panel.charts.addEventListener("dblclick", () => span(panel, [0, Infinity]));
    panel.slider.addEventListener("input", () => moveTo(panel, Number(panel.slider.value)));
    const tools = { in: () => zoom(panel, 1.6), out: () => zoom(panel, 1 / 1.6), fit: () => { look(panel, fit(panel)); span(panel, [0, Infinity]); } };
    for (const button of panel.root.querySelectorAll("[data-do]"))
      button.addEventListener("click", () => (button.dataset.do === "play" ? play(panel, button) : tools[button.dataset.do]()));
    for (const row of panel.root.querySelectorAll("tr[data-s]")) {
      row.addEventListener("click", () => visit(panel, Number(row.dataset.s)));
      row.addEventListener("keydown", (event) => { if (event.key === "Enter") visit(panel, Number(row.dataset.s)); });
    }
    const worst = panel.breaches.length ? panel.breaches[0].deepest : panel.plan.places[0].s / panel.plan.spacing;
    panel.cursor = clamp(Math.round(worst), 0, panel.plan.count - 1);
  }
  for (const panel of panels) { // where bodies would be specks on a map of the whole road, it opens at what decides
    if (!panel.map.clientWidth || fit(panel).scale >= SPECK) continue;
    panel.view = { x: panel.at.x[panel.cursor], y: panel.at.y[panel.cursor], scale: Math.min(panel.map.clientWidth, panel.map.clientHeight) / 90 };
  }

  for (const button of document.querySelectorAll("nav [data-show]")) {
    button.addEventListener("click", () => {
      const which = button.dataset.show;
      for (const other of document.querySelectorAll("nav [data-show]")) other.setAttribute("aria-pressed", String(other === button));
      document.getElementById("plans").classList.toggle("single", which !== "all");
      panels.forEach((panel, number) => { panel.root.hidden = which !== "all" && String(number) !== which; panel.view = null; redraw(panel); });
    });
  }
  const all = () => panels.forEach(redraw);
  const paper = (on) => {
    printing = on;
    document.documentElement.classList.toggle("printing", on);
    for (const panel of panels) { drawMap(panel); drawCharts(panel); }
  };
  window.addEventListener("beforeprint", () => paper(true));
  window.addEventListener("afterprint", () => paper(false));
  window.addEventListener("resize", all);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  all();
})();
