"use strict";
// One map and one table of the same places; the filters hold for both.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const MOST_ROWS = 500, HIT_PX = 14, ZOOM = 1.5, EARTH_M = 6371000, YES = 0, NO = 1;
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const form = document.getElementById("filters"), canvas = document.querySelector(".plane"), readout = document.querySelector(".readout");
  const body = document.querySelector("#places tbody"), heads = [...document.querySelectorAll("#places thead th")];
  // Mercator: angles stay true at every zoom.
  const place = ([lon, lat]) => [(lon * Math.PI) / 180, Math.asinh(Math.tan((lat * Math.PI) / 180))];

  const roads = data.roads.map((road) => ({ name: road.name, points: road.line.map(place), word: "unknown" }));
  const places = data.places.map((one) => ({ ...one, at: one.lon === undefined ? null : place([one.lon, one.lat]),
    text: [one.road, one.vehicle, one.side, one.unit, one.part, one.obstacle, one.which_vehicles, one.which_roads, one.width].join(" ").toLowerCase() }));
  let shown = places, chosen = null, view = null, order = { by: "rank", down: false };

  // ---- filters
  function filter() {
    const width = form.width.value, vehicle = form.vehicle.value, most = parseFloat(form.most.value), count = parseInt(form.count.value) || 1;
    const words = form.words.value.toLowerCase().split(/\s+/).filter(Boolean);
    shown = places.filter((one) => (width === "" || one.width === data.widths[width]) && (vehicle === "" || one.which_vehicles.split("; ").includes(vehicle))
      && (isNaN(most) || one.widening_m <= most) && one.vehicles >= count && words.every((word) => one.text.includes(word)));
    const number = vehicle === "" ? -1 : data.vehicles.indexOf(vehicle), seen = roads.map(() => [0, 0, 0]);
    for (const [road, of, at, word] of data.courses) {
      if ((number < 0 || of === number) && (width === "" || at === Number(width))) seen[road][word === YES ? 0 : word === NO ? 1 : 2] += 1;
    }
    roads.forEach((road, i) => {
      const [yes, no] = seen[i];
      road.word = yes && no ? "some" : yes ? "fits" : no ? "none" : "unknown";
    });
    if (!shown.includes(chosen)) chosen = null;
    sort();
  }

  function sort() {
    const { by, down } = order, sign = down ? -1 : 1;
    const missing = (one) => one[by] === undefined;
    shown.sort((a, b) => (missing(a) || missing(b) ? missing(a) - missing(b) : sign * (a[by] < b[by] ? -1 : a[by] > b[by] ? 1 : 0)) || a.rank - b.rank);
    heads.forEach((head) => (head.dataset.by === by ? head.setAttribute("aria-sort", down ? "descending" : "ascending") : head.removeAttribute("aria-sort")));
    list();
    draw();
  }

  // ---- table
  function list() {
    body.replaceChildren(...shown.slice(0, MOST_ROWS).map((one) => {
      const row = document.createElement("tr");
      row.tabIndex = 0;
      row.classList.toggle("chosen", one === chosen);
      for (const head of heads) {
        const cell = document.createElement("td"), value = one[head.dataset.by];
        cell.textContent = value === undefined ? "-" : head.dataset.by.startsWith("widening") ? value.toFixed(2) : value;
        if (head.classList.contains("text")) cell.className = "text";
        row.append(cell);
      }
      row.onclick = () => choose(one, true);
      row.onkeydown = (event) => { if (event.key === "Enter") choose(one, true); };
      return row;
    }));
    const rest = shown.length - MOST_ROWS;
    document.getElementById("shown").textContent = `${shown.length} of ${places.length} places` + (rest > 0 ? `; the table shows the first ${MOST_ROWS}` : "");
  }

  function choose(one, centre) {
    chosen = one;
    if (one && one.at && centre) view = { x: one.at[0], y: one.at[1], scale: Math.max(view.scale, (400 * EARTH_M * Math.cos((one.lat * Math.PI) / 180)) / 400) };
    readout.textContent = one ? describe(one) : "\u00a0";
    list();
    draw();
  }

  function describe(one) {
    const lacking = one.widening_m === undefined ? "the vehicle cannot be planned further" : `${one.widening_m.toFixed(2)} m lacking`;
    return `${one.road}, s = ${one.s_m} m, ${one.width}: ${lacking}${one.side ? ` on the ${one.side}` : ""}; ${one.which_vehicles}`;
  }

  // ---- map
  function fit() {
    let box = [Infinity, -Infinity, Infinity, -Infinity];
    const take = ([x, y]) => { box = [Math.min(box[0], x), Math.max(box[1], x), Math.min(box[2], y), Math.max(box[3], y)]; };
    roads.forEach((road) => road.points.forEach(take));
    places.forEach((one) => one.at && take(one.at));
    if (box[0] > box[1]) return { x: 0, y: 0, scale: 100 };
    const across = Math.max(box[1] - box[0], 1e-6), up = Math.max(box[3] - box[2], 1e-6);
    return { x: (box[0] + box[1]) / 2, y: (box[2] + box[3]) / 2, scale: 0.92 * Math.min(canvas.clientWidth / across, canvas.clientHeight / up) };
  }

  const onPage = ([x, y]) => [canvas.clientWidth / 2 + (x - view.x) * view.scale, canvas.clientHeight / 2 - (y - view.y) * view.scale];
  const size = (one) => 4 + 6 * Math.min(1, one.widening_m === undefined ? 1 : one.widening_m);

  function draw() {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width) return;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    view ??= fit();
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const dashes = { fits: [], some: [7, 4], none: [], unknown: [2, 3] }, colours = {};
    for (const word in dashes) colours[word] = css(`--${word}`);
    pen.lineWidth = 2;
    for (const word of ["unknown", "fits", "some", "none"]) {
      pen.strokeStyle = colours[word];
      pen.setLineDash(dashes[word]);
      for (const road of roads) {
        if (road.word !== word) continue;
        pen.beginPath();
        road.points.forEach((point, i) => (i ? pen.lineTo(...onPage(point)) : pen.moveTo(...onPage(point))));
        pen.stroke();
      }
    }
    pen.setLineDash([]);
    for (const one of [...shown].reverse()) {
      if (!one.at) continue;
      pen.globalAlpha = 0.75;
      pen.fillStyle = colours.none;
      pen.beginPath();
      pen.arc(...onPage(one.at), size(one), 0, 2 * Math.PI);
      pen.fill();
      pen.globalAlpha = 1;
      pen.lineWidth = 1;
      pen.strokeStyle = css("--paper");
      pen.stroke();
    }
    if (chosen && chosen.at) {
      pen.strokeStyle = css("--ink");
      pen.lineWidth = 2.5;
      pen.beginPath();
      pen.arc(...onPage(chosen.at), size(chosen) + 4, 0, 2 * Math.PI);
      pen.stroke();
    }
    scaleBar(pen, height);
  }

  function scaleBar(pen, height) {
    const metres = (EARTH_M / Math.cosh(view.y)) / view.scale; // of a pixel, at the middle
    const power = 10 ** Math.floor(Math.log10(120 * metres)), digit = [5, 2, 1].find((one) => one * power <= 120 * metres) || 1;
    const length = digit * power, text = length >= 1000 ? `${length / 1000} km` : `${length} m`;
    pen.strokeStyle = pen.fillStyle = css("--ink");
    pen.lineWidth = 2;
    pen.font = "12px system-ui, sans-serif";
    pen.beginPath();
    pen.moveTo(14, height - 20);
    pen.lineTo(14, height - 14);
    pen.lineTo(14 + length / metres, height - 14);
    pen.lineTo(14 + length / metres, height - 20);
    pen.stroke();
    pen.fillText(text, 18, height - 20);
  }

  function zoom(factor, [x, y] = [canvas.clientWidth / 2, canvas.clientHeight / 2]) {
    const dx = (x - canvas.clientWidth / 2) / view.scale, dy = (canvas.clientHeight / 2 - y) / view.scale;
    view = { x: view.x + dx * (1 - 1 / factor), y: view.y + dy * (1 - 1 / factor), scale: view.scale * factor };
    draw();
  }

  function near(x, y) {
    let found = null, least = HIT_PX;
    for (const one of shown) {
      if (!one.at) continue;
      const [u, v] = onPage(one.at), apart = Math.hypot(u - x, v - y) - size(one) / 2;
      if (apart < least) [found, least] = [one, apart];
    }
    return found;
  }

  let drag = null;
  const spot = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  canvas.onpointerdown = (event) => { drag = { at: spot(event), moved: false, view }; canvas.setPointerCapture(event.pointerId); };
  canvas.onpointermove = (event) => {
    const [x, y] = spot(event);
    if (!drag) { const one = near(x, y) || chosen; readout.textContent = one ? describe(one) : "\u00a0"; return; }
    const [dx, dy] = [x - drag.at[0], y - drag.at[1]];
    drag.moved ||= Math.hypot(dx, dy) > 3;
    view = { ...drag.view, x: drag.view.x - dx / view.scale, y: drag.view.y + dy / view.scale };
    draw();
  };
  canvas.onpointerup = (event) => { if (drag && !drag.moved) choose(near(...spot(event)), false); drag = null; };
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(event.deltaY < 0 ? ZOOM : 1 / ZOOM, spot(event)); }, { passive: false });
  canvas.onkeydown = (event) => {
    const step = 60 / view.scale, moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
    if (moves) { view = { ...view, x: view.x + moves[0], y: view.y + moves[1] }; draw(); }
    else if (event.key === "+") zoom(ZOOM);
    else if (event.key === "-") zoom(1 / ZOOM);
    else if (event.key === "0") { view = fit(); draw(); }
    else return;
    event.preventDefault();
  };
  for (const button of document.querySelectorAll(".tools button")) {
    button.onclick = () => ({ in: () => zoom(ZOOM), out: () => zoom(1 / ZOOM), fit: () => { view = fit(); draw(); } })[button.dataset.do]();
  }
  for (const head of heads) head.onclick = () => { order = { by: head.dataset.by, down: order.by === head.dataset.by && !order.down }; sort(); };
  form.oninput = form.onchange = filter;
  form.onsubmit = (event) => event.preventDefault();
  window.onresize = draw;
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  filter();
})();
