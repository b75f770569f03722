"use strict";
(() => {
  const live = document.body.dataset.live === "yes";
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const $ = (selector) => document.querySelector(selector);
  const FIELD_OF_VIEW = 35;
  const CHUNK = 256; // faces that share a box, for the search of what a ray meets
  const MARK = 0xff4d2e;
  const ROUTE = 0x0b3d91;
  const TRACK = 0x2b2118;
  const WALL = [96, 96, 104]; // in layers that say nothing of walls
  const BLOCK = [205, 201, 196], SECTION = 0x8a6f5a; // below the ground, and where a cut goes through
  // J. R. Nuñez, C. R. Anderton, R. S. Renslow, Optimizing colormaps with consideration for color
  // vision deficiency, PLOS ONE 13(7), 2018; viridis by N. J. Smith and S. van der Walt, 2015
  const RAMPS = {
    height: "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
    slope: "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
  };
  const VIEWS = {
    top: [180, 90], north: [0, 0], east: [90, 0], south: [180, 0], west: [270, 0], home: [215, 35],
  };

  // --- the scene, as scene.py writes it ----------------------------------------------------------

  async function unpack(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const data = new Uint8Array(await new Response(stream).arrayBuffer());
    const size = new DataView(data.buffer).getUint32(0, true);
    const told = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + size)));
    let at = 4 + size;
    for (const { name, rows, columns } of told.arrays) {
      const values = new Int32Array(rows * columns);
      for (let column = 0; column < columns; column += 1, at += 4 * rows) {
        let sum = 0;
        for (let row = 0, a = at, b = at + rows, c = at + 2 * rows, d = at + 3 * rows; row < rows; row += 1) {
          sum = (sum + (data[a + row] | data[b + row] << 8 | data[c + row] << 16 | data[d + row] << 24)) | 0;
          values[row * columns + column] = sum;
        }
      }
      told[name] = values;
    }
    return told;
  }

  function embedded() {
    const text = atob($("#scene").textContent.trim());
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i += 1) bytes[i] = text.charCodeAt(i);
    return bytes;
  }

  /** What the mesh is to pointers: rays from anywhere, and what is at an x and y. */
  class Ground {
    constructor(told) {
      const { positions, corners, steps } = told;
      this.told = told;
      this.faces = corners.length / 3;
      this.points = new Float64Array(positions.length);
      for (let i = 0; i < positions.length; i += 1) this.points[i] = positions[i] * steps[i % 3];
      this.boxes = new Float64Array(6 * Math.ceil(this.faces / CHUNK)).fill(-Infinity);
      for (let chunk = 0; chunk * CHUNK < this.faces; chunk += 1) {
        const box = this.boxes.subarray(6 * chunk, 6 * chunk + 6);
        box.fill(Infinity, 0, 3);
        const end = Math.min(3 * CHUNK * (chunk + 1), corners.length);
        for (let i = 3 * CHUNK * chunk; i < end; i += 1) {
          for (let axis = 0; axis < 3; axis += 1) {
            const value = this.points[3 * corners[i] + axis];
            if (value < box[axis]) box[axis] = value;
            if (value > box[axis + 3]) box[axis + 3] = value;
          }
        }
      }
    }

    /** The first face that a ray meets below a height: {face, t}; null for none. */
    meets(origin, direction, most = Infinity) {
      let best = null;
      for (let chunk = 0; 6 * chunk < this.boxes.length; chunk += 1) {
        let near = 0, far = best ? best.t : Infinity;
        for (let axis = 0; axis < 3 && near <= far; axis += 1) {
          const low = this.boxes[6 * chunk + axis] - origin[axis];
          const high = this.boxes[6 * chunk + axis + 3] - origin[axis];
          if (direction[axis] === 0) {
            if (low > 0 || high < 0) far = -1;
            continue;
          }
          const a = low / direction[axis], b = high / direction[axis];
          near = Math.max(near, Math.min(a, b));
          far = Math.min(far, Math.max(a, b));
        }
        if (near > far) continue;
        const end = Math.min((chunk + 1) * CHUNK, this.faces);
        for (let face = chunk * CHUNK; face < end; face += 1) {
          const t = this.crossing(face, origin, direction);
          if (t > 0 && (!best || t < best.t) && origin[2] + t * direction[2] <= most) best = { face, t };
        }
      }
      return best;
    }

    /** Where a ray meets a face (T. Möller and B. Trumbore, Fast, minimum storage ray/triangle
     * intersection, Journal of Graphics Tools 2(1), 1997); -1 for nowhere. */
    crossing(face, o, d) {
      const p = this.points, c = this.told.corners;
      const a = 3 * c[3 * face], b = 3 * c[3 * face + 1], e = 3 * c[3 * face + 2];
      const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
      const vx = p[e] - p[a], vy = p[e + 1] - p[a + 1], vz = p[e + 2] - p[a + 2];
      const hx = d[1] * vz - d[2] * vy, hy = d[2] * vx - d[0] * vz, hz = d[0] * vy - d[1] * vx;
      const det = ux * hx + uy * hy + uz * hz;
      if (det === 0) return -1;
      const sx = o[0] - p[a], sy = o[1] - p[a + 1], sz = o[2] - p[a + 2];
      const u = (sx * hx + sy * hy + sz * hz) / det;
      if (u < -1e-9 || u > 1 + 1e-9) return -1;
      const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux;
      const v = (d[0] * qx + d[1] * qy + d[2] * qz) / det;
      if (v < -1e-9 || u + v > 1 + 1e-9) return -1;
      return (vx * qx + vy * qy + vz * qz) / det;
    }

    /** The top at an x and y that is nearest to z: {face, weights}; null outside and in the void.
     * On an edge it is that of the east and north side, as of queries. */
    under(x, y, z) {
      const step = this.told.steps[0], tops = [0, this.told.ground_faces];
      const nearest = (found) => (best, one) => (found(one) < found(best) ? one : best);
      for (const at of [[x + step, y + step], [x, y]]) {
        const listed = this.holding(...at, ...tops);
        if (listed.length) return listed.reduce(nearest((one) => Math.abs(this.at(one).z - z)));
      }
      return null;
    }

    /** All faces of a range over an x and y: {face, weights}. */
    holding(x, y, from, to) {
      const found = [];
      for (let chunk = Math.floor(from / CHUNK); chunk * CHUNK < to; chunk += 1) {
        const box = 6 * chunk;
        if (x < this.boxes[box] || x > this.boxes[box + 3]) continue;
        if (y < this.boxes[box + 1] || y > this.boxes[box + 4]) continue;
        const end = Math.min((chunk + 1) * CHUNK, to);
        for (let face = Math.max(chunk * CHUNK, from); face < end; face += 1) {
          const weights = this.weights(face, x, y);
          if (weights && Math.min(...weights) >= -1e-9) {
            found.push({ face, weights });
            if (!this.told.storeys) return found; // there is one at most
          }
        }
      }
      return found;
    }

    /** Heights of tops, or of undersides, at an x and y. */
    heights(x, y, under = false) {
      const { ground_faces: tops, under_faces: down } = this.told;
      return this.holding(x, y, under ? tops : 0, under ? tops + down : tops).map((one) => this.at(one).z);
    }

    /** Shares of the corners of a face at an x and y. */
    weights(face, x, y) {
      const p = this.points, c = this.told.corners;
      const a = 3 * c[3 * face], b = 3 * c[3 * face + 1], e = 3 * c[3 * face + 2];
      const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1];
      const vx = p[e] - p[a], vy = p[e + 1] - p[a + 1];
      const det = ux * vy - uy * vx;
      if (det === 0) return null;
      const sx = x - p[a], sy = y - p[a + 1];
      const u = (sx * vy - sy * vx) / det, v = (ux * sy - uy * sx) / det;
      return [1 - u - v, u, v];
    }

    /** Height and slope (degrees) of a face at shares of its corners. */
    at({ face, weights }) {
      let z = 0, east = 0, north = 0;
      weights.forEach((weight, corner) => {
        const wedge = this.told.corners[3 * face + corner];
        const nx = this.told.normals[2 * wedge] / 32767, ny = this.told.normals[2 * wedge + 1] / 32767;
        const nz = Math.sqrt(Math.max(1e-12, 1 - nx * nx - ny * ny));
        z += weight * this.points[3 * wedge + 2];
        east -= weight * nx / nz;
        north -= weight * ny / nz;
      });
      return { z, slope: Math.atan(Math.hypot(east, north)) * 180 / Math.PI };
    }

    /** What a face is: a top, an underside or a ceiling, a wall, or a side of the block. */
    kind(face) {
      const { ground_faces: tops, under_faces: down, block_faces: block } = this.told;
      if (face < tops) return "top";
      if (face < tops + down) return "underside";
      return face < this.faces - block ? "wall" : "block";
    }

    /** Which way a face faces, unit vector. */
    facing(face) {
      const p = this.points, c = this.told.corners;
      const [a, b, e] = [0, 1, 2].map((k) => 3 * c[3 * face + k]);
      const u = [0, 1, 2].map((k) => p[b + k] - p[a + k]), v = [0, 1, 2].map((k) => p[e + k] - p[a + k]);
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const size = Math.hypot(...n) || 1;
      return n.map((value) => value / size);
    }
  }

  // --- what is drawn ------------------------------------------------------------------------------

  const canvas = $("#view");
  const NO_WEBGL = "This browser has no WebGL, so the terrain cannot be drawn. " +
    "Switch on its graphics acceleration, or open the page in another browser.";
  const renderer = drawer();
  const stage = new THREE.Scene();
  // level ground has its own colour: 0.5 + 0.7071 · sin 45° = 1
  stage.add(new THREE.AmbientLight(0xffffff, 0.5));
  const sun = new THREE.DirectionalLight(0xffffff, Math.SQRT1_2);
  stage.add(sun);
  const perspective = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.1, 1000);
  const parallel = new THREE.OrthographicCamera(-1, 1, 1, -1, -1000, 1000);
  const root = new THREE.Group();
  stage.add(root);

  /** What draws; null where the browser has nothing to draw with. */
  function drawer() {
    try {
      const made = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
      made.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
      made.setClearColor(0, 0);
      return made;
    } catch (error) {
      return null;
    }
  }

  /** Say what the page waits for, or why it shows nothing. */
  function busy(text) {
    $("#busy").textContent = text || (renderer ? "" : NO_WEBGL);
  }

  const cutting = new THREE.Plane(new THREE.Vector3(0, 0, -1), 0);
  let cut = Infinity; // height above which nothing is shown
  const eye = { target: new THREE.Vector3(), distance: 1, azimuth: 215, elevation: 35, parallel: false, fitted: false };
  let told = null, ground = null, geometry = null, materials = null, inside = null, drapes = {}, lines = null, mark = null;
  let layer = "surface", picked = null, waiting = false, exact = null, picture = 0;

  const tan = Math.tan(FIELD_OF_VIEW * Math.PI / 360);
  const size = () => [canvas.clientWidth || 1, canvas.clientHeight || 1];
  const radians = (degrees) => degrees * Math.PI / 180;

  /** The axes of the picture: to the right, up, and towards the eye. */
  function axes() {
    const a = radians(eye.azimuth), e = radians(eye.elevation);
    return {
      right: new THREE.Vector3(-Math.cos(a), Math.sin(a), 0),
      up: new THREE.Vector3(-Math.sin(e) * Math.sin(a), -Math.sin(e) * Math.cos(a), Math.cos(e)),
      back: new THREE.Vector3(Math.cos(e) * Math.sin(a), Math.cos(e) * Math.cos(a), Math.sin(e)),
    };
  }

  /** Length in the world of a pixel at the target. */
  const perPixel = () => 2 * eye.distance * tan / size()[1];

  function place() {
    const [width, height] = size();
    const { up, back } = axes();
    const camera = eye.parallel ? parallel : perspective;
    if (told && cut < Infinity) cutting.constant = (cut - told.origin[2]) * root.scale.z;
    const reach = told ? radius() : 1;
    camera.position.copy(eye.target).addScaledVector(back, eye.distance);
    camera.up.copy(up);
    camera.lookAt(eye.target);
    if (eye.parallel) {
      const half = eye.distance * tan;
      Object.assign(camera, {
        left: -half * width / height, right: half * width / height, top: half, bottom: -half,
        near: -4 * reach - eye.distance, far: 4 * reach + eye.distance,
      });
    } else {
      Object.assign(camera, {
        aspect: width / height, near: Math.max(eye.distance - 3 * reach, eye.distance / 100),
        far: eye.distance + 4 * reach,
      });
    }
    // light comes from the left: from the north-west seen from above, from the front at a side
    const from = radians(eye.azimuth + 45 + Math.max(0, eye.elevation));
    sun.position.set(Math.sin(from), Math.cos(from), 1);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    return camera;
  }

  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      if (!renderer) {
        document.body.dataset.shown = "no";
        return;
      }
      const [width, height] = size();
      const ratio = renderer.getPixelRatio();
      if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
        renderer.setSize(width, height, false);
      }
      renderer.render(stage, place());
      furnish();
      if (told) document.body.dataset.shown = "yes";
    });
  }

  /** The arrow to the north and the scale. */
  function furnish() {
    const { right, up } = axes();
    $("#needle").style.transform = `rotate(${Math.atan2(right.y, up.y)}rad)`;
    $("#north").style.visibility = Math.hypot(right.y, up.y) < 0.02 ? "hidden" : "visible";
    const most = 140 * perPixel(), power = 10 ** Math.floor(Math.log10(most));
    const long = [5, 2, 1].find((factor) => factor * power <= most) * power;
    $("#scale").style.width = `${long / perPixel()}px`;
    $("#scale span").textContent = `${number(long, 6)} m${eye.parallel ? "" : " in the middle"}`;
  }

  const radius = () => {
    const [west, south, east, north] = told.bounds;
    return 0.5 * Math.hypot(east - west, north - south, (told.heights[1] - told.heights[0]) * root.scale.z) || 1;
  };

  /** Look from somewhere, at all of it. */
  function look(name) {
    [eye.azimuth, eye.elevation] = VIEWS[name];
    eye.parallel = name !== "home";
    fit();
    say(null);
  }

  /** Have all of the terrain in the view, as large as it fits, and until it is moved. */
  function fit() {
    const [west, south, east, north] = told.bounds, [low, high] = told.heights;
    const from = [west, south, low].map((value, axis) => (value - told.origin[axis]) * (axis > 1 ? root.scale.z : 1));
    const to = [east, north, high].map((value, axis) => (value - told.origin[axis]) * (axis > 1 ? root.scale.z : 1));
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => new THREE.Vector3(
      ...[0, 1, 2].map((axis) => (corner >> axis & 1 ? to : from)[axis])));
    const { right, up, back } = axes(), [width, height] = size();
    const away = new THREE.Vector3(-back.x, -back.y, 0).normalize();
    eye.target.set(...from.map((value, axis) => (value + to[axis]) / 2));
    for (let turn = 0; turn < 12; turn += 1) {
      const seen = corners.map((corner) => {
        const point = corner.clone().sub(eye.target);
        return [point.dot(right), point.dot(up), point.dot(back)];
      });
      eye.distance = Math.max(1e-6, ...seen.map(([x, y, near]) => (eye.parallel ? 1.1 : 1.06)
        * Math.max(Math.abs(y), Math.abs(x) * height / width) / tan + (eye.parallel ? 0 : near)));
      if (eye.parallel) break; // the middle is in the middle
      // what is near looks larger: the target moves over the ground until both sides have as much room
      const [across, upwards] = [0, 1].map((axis) => {
        const all = seen.map((point) => point[axis] / (eye.distance - point[2]));
        return (Math.min(...all) + Math.max(...all)) / 2 * eye.distance;
      });
      eye.target.addScaledVector(right, across).addScaledVector(away, upwards / up.dot(away));
    }
    eye.fitted = true;
    draw();
  }

  // --- colours ------------------------------------------------------------------------------------

  const stops = Object.fromEntries(Object.entries(RAMPS).map(([name, text]) => [name,
    text.split(" ").map((hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16)))]));

  function ramp(name, share) {
    const list = stops[name], at = Math.min(Math.max(share, 0), 1) * (list.length - 1);
    const low = Math.min(Math.floor(at), list.length - 2);
    return list[low].map((value, k) => value + (list[low + 1][k] - value) * (at - low));
  }

  function slopeOf(wedge) {
    const nx = told.normals[2 * wedge] / 32767, ny = told.normals[2 * wedge + 1] / 32767;
    return Math.asin(Math.min(1, Math.hypot(nx, ny))) * 180 / Math.PI;
  }

  /** The end of the scale of slopes: a round number of degrees that little of the ground exceeds. */
  function steepest() {
    const areas = new Float64Array(91), p = ground.points;
    for (let face = 0; face < told.ground_faces; face += 1) {
      const [a, b, c] = [0, 1, 2].map((k) => 3 * told.corners[3 * face + k]);
      const area = (p[b] - p[a]) * (p[c + 1] - p[a + 1]) - (p[b + 1] - p[a + 1]) * (p[c] - p[a]);
      areas[Math.floor(slopeOf(told.corners[3 * face]))] += Math.abs(area);
    }
    let left = 0.01 * areas.reduce((sum, area) => sum + area, 0), degrees = 90;
    while (degrees > 0 && (left -= areas[degrees]) >= 0) degrees -= 1;
    return [5, 10, 15, 20, 30, 45, 60, 90].find((end) => end > degrees) || 90;
  }

  function paint() {
    const wedges = told.positions.length / 3;
    const colors = geometry.attributes.color.array;
    const [low, high] = told.heights, range = high - low || 1;
    const end = layer === "slope" ? steepest() : 0;
    const put = (wedge, color) => {
      for (let k = 0; k < 3; k += 1) colors[4 * wedge + k] = color[k];
      colors[4 * wedge + 3] = 255;
    };
    const done = new Uint8Array(wedges);
    for (let face = 0; face < ground.faces; face += 1) {
      const kind = ground.kind(face), surface = told.faceSurfaces[face];
      const plain = kind !== "top" || (drapes[layer] && told.raised && told.raised[face]);
      for (let corner = 3 * face; corner < 3 * face + 3; corner += 1) {
        const wedge = told.corners[corner];
        if (done[wedge]) continue;
        done[wedge] = 1;
        if (kind === "block") {
          put(wedge, BLOCK);
        } else if (layer === "height") {
          put(wedge, ramp("height", (ground.points[3 * wedge + 2] + told.origin[2] - low) / range));
        } else if (layer === "slope") {
          put(wedge, plain ? WALL : ramp("slope", slopeOf(wedge) / end));
        } else if (drapes[layer]) {
          put(wedge, plain ? WALL : [255, 255, 255]);
        } else {
          put(wedge, told.surfaces.at(surface).color);
        }
      }
    }
    geometry.attributes.color.needsUpdate = true;
    materials[0].map = drapes[layer] || null;
    materials[0].needsUpdate = true;
    legend(end);
    draw();
  }

  function legend(end) {
    const box = $("#legend");
    box.replaceChildren();
    if (layer === "height" || layer === "slope") {
      const bar = element("canvas");
      [bar.width, bar.height] = [256, 1];
      const brush = bar.getContext("2d");
      for (let x = 0; x < 256; x += 1) {
        brush.fillStyle = `rgb(${ramp(layer, x / 255).map(Math.round).join(" ")})`;
        brush.fillRect(x, 0, 1, 1);
      }
      const ends = element("div", { className: "ends" });
      const texts = layer === "height"
        ? told.heights.map((z) => `${number(z, 3)} m`) : ["0°", `${end}°${end < 90 ? " and more" : ""}`];
      ends.append(...texts.map((text) => element("span", { textContent: text })));
      box.append(bar, ends);
      if (layer === "slope") box.append(swatch(WALL, told.storeys ? "wall, underside" : "wall"));
      return;
    }
    const present = new Set(told.faceSurfaces.subarray(0, ground.faces - told.block_faces));
    const rows = drapes[layer]
      ? told.map.classes.map((one, index) => [one, told[layer].filter((code) => code === index).length])
        .filter(([, count]) => count)
        .map(([one, count]) => swatch(one.color, `${one.name}, ${number(100 * count / told[layer].length, 1)} %`))
      : told.surfaces.map((one, index) => [one, index === told.surfaces.length - 1 ? -1 : index])
        .filter(([, index]) => present.has(index))
        .map(([one]) => swatch(one.color, one.name || "no surface", one.descr));
    if (drapes[layer]) rows.push(swatch(WALL, told.storeys ? "wall, underside, and tops over others" : "wall"));
    box.append(...rows);
  }

  function swatch(color, text, title = "") {
    const row = element("div", { className: "row", title });
    const patch = element("span", { className: "swatch" });
    patch.style.backgroundColor = `rgb(${color.join(" ")})`;
    row.append(patch, element("span", { textContent: text }));
    return row;
  }

  function element(tag, properties = {}) {
    return Object.assign(document.createElement(tag), properties);
  }

  /** A number with so many digits behind the point at most. */
  function number(value, digits) {
    return String(Number(value.toFixed(Math.min(Math.max(digits, 0), 12))));
  }

  // --- a terrain is shown --------------------------------------------------------------------------

  function show(scene) {
    const first = told === null, before = picked && told.names[picked];
    const anchor = first ? null : eye.target.clone().add(new THREE.Vector3(
      told.origin[0], told.origin[1], told.origin[2] * root.scale.z));
    const extent = first ? "" : told.bounds.join();
    clear();
    told = scene;
    ground = new Ground(told);
    build();
    describe();
    paint();
    drawLines();
    if (first || extent !== told.bounds.join()) look("home");
    else eye.target.copy(anchor.sub(new THREE.Vector3(told.origin[0], told.origin[1], told.origin[2] * root.scale.z)));
    const again = before ? told.names.indexOf(before) : -1;
    pick(again >= 0 ? again : null);
    $("#readout").replaceChildren();
    busy("");
    draw();
  }

  function clear() {
    for (const child of [...root.children]) {
      root.remove(child);
      child.geometry?.dispose();
    }
    for (const one of [...materials || [], ...inside ? [inside.material] : []]) one.dispose();
    for (const one of Object.values(drapes)) one.dispose();
    mark = lines = null;
    drapes = {};
  }

  function build() {
    const wedges = told.positions.length / 3;
    const normals = new Float32Array(3 * wedges);
    for (let wedge = 0; wedge < wedges; wedge += 1) {
      const nx = told.normals[2 * wedge] / 32767, ny = told.normals[2 * wedge + 1] / 32767;
      normals.set([nx, ny, Math.sqrt(Math.max(0, 1 - nx * nx - ny * ny))], 3 * wedge);
    }
    const down = told.ground_faces + told.under_faces;
    for (let corner = 3 * told.ground_faces; corner < 3 * down; corner += 1) {
      const at = 3 * told.corners[corner] + 2;
      normals[at] = -Math.abs(normals[at]);
    }
    geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(ground.points), 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Uint8Array(4 * wedges), 4, true));
    geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(told.corners), 1));
    geometry.addGroup(0, 3 * told.ground_faces, 0);
    geometry.addGroup(3 * told.ground_faces, told.corners.length - 3 * told.ground_faces, 1);
    const common = {
      vertexColors: true, side: THREE.DoubleSide,
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    };
    materials = [new THREE.MeshLambertMaterial(common), new THREE.MeshLambertMaterial(common)];
    drapes = told.map ? { verdict: texture(told.verdict), worst: texture(told.worst) } : {};
    const mesh = new THREE.Mesh(geometry, materials);
    // solids are closed: where a cut opens them, their insides look like what was cut
    inside = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: SECTION, side: THREE.BackSide }));
    mesh.frustumCulled = inside.frustumCulled = false;
    root.add(mesh, inside, frame());
    $("#cut").hidden = !told.storeys;
    slice(told.storeys ? Number($("#cut input").value) : 100);
    $("#verdict").hidden = $("#worst").hidden = !told.map;
  }

  /** A map of verdicts, and where each vertex lies in it. */
  function texture(codes) {
    const { west, south, resolution, width, height, classes } = told.map;
    const pixels = new Uint8Array(4 * width * (height + 1)).fill(255); // a white row for what has no verdict
    codes.forEach((one, pixel) => pixels.set(classes[one].color, 4 * pixel));
    const wedges = told.positions.length / 3, places = new Float32Array(2 * wedges);
    for (let wedge = 0; wedge < wedges; wedge += 1) {
      places[2 * wedge] = (ground.points[3 * wedge] + told.origin[0] - west) / (width * resolution);
      places[2 * wedge + 1] = (ground.points[3 * wedge + 1] + told.origin[1] - south) / ((height + 1) * resolution);
    }
    (told.raised || []).forEach((raised, face) => {
      if (raised) for (let k = 0; k < 3; k += 1) places[2 * told.corners[3 * face + k] + 1] = 1 - 0.5 / (height + 1);
    });
    geometry.setAttribute("uv", new THREE.BufferAttribute(places, 2));
    const map = new THREE.DataTexture(pixels, width, height + 1, THREE.RGBAFormat);
    map.magFilter = map.minFilter = THREE.NearestFilter;
    map.needsUpdate = true;
    return map;
  }

  /** The sides of the terrain at its lowest height. */
  function frame() {
    const [west, south, east, north] = told.bounds;
    const corners = [[west, south], [east, south], [east, north], [west, north]]
      .map(([x, y]) => new THREE.Vector3(x - told.origin[0], y - told.origin[1], told.heights[0] - told.origin[2]));
    const outline = new THREE.LineLoop(
      new THREE.BufferGeometry().setFromPoints(corners), new THREE.LineBasicMaterial({ color: 0x808890 }));
    outline.frustumCulled = false;
    return outline;
  }

  function drawLines() {
    lines = new THREE.Group();
    const [west, south, east, north] = told.bounds;
    const thick = Math.max(east - west, north - south) / 900;
    for (const { points } of told.tracks) lines.add(...tube(points, 0.4 * thick, TRACK));
    for (const route of told.routes) if (route.found) lines.add(...tube(route.points, thick, ROUTE));
    root.add(lines);
    $("#lines").hidden = !lines.children.length;
    lines.visible = $("#lines input").checked;
    $("#routes").replaceChildren(...told.routes.map((route) => element("li", { textContent: told_of(route) })));
  }

  function told_of(route) {
    const ends = route.ends.map(([x, y]) => `${number(x, 3)} ${number(y, 3)}`).join(" → ");
    return route.found
      ? `${ends}: ${route.verdict}, ${number(route.length, 1)} m, ${number(route.time, 0)} s`
      : `${ends}: no way. ${route.note}`;
  }

  /** A line with a thickness: seen, and faintly where ground hides it. */
  function tube(points, thick, color) {
    const vertices = [], index = [];
    for (let i = 1; i < points.length; i += 1) {
      const [a, b] = [points[i - 1], points[i]];
      const long = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
      const side = [-(b[1] - a[1]) / long * thick, (b[0] - a[0]) / long * thick];
      const along = [(b[0] - a[0]) / long * thick / 2, (b[1] - a[1]) / long * thick / 2];
      const first = vertices.length / 3;
      [[a, -1], [b, 1]].forEach(([end, sign]) => {
        const [x, y] = [end[0] + sign * along[0], end[1] + sign * along[1]];
        vertices.push(x + side[0], y + side[1], end[2], x, y, end[2] + thick,
          x - side[0], y - side[1], end[2], x, y, end[2] - thick);
      });
      for (let k = 0; k < 4; k += 1) {
        const [p, q] = [first + k, first + (k + 1) % 4];
        index.push(p, q, q + 4, p, q + 4, p + 4);
      }
    }
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(vertices), 3));
    shape.setIndex(index);
    const common = { color, side: THREE.DoubleSide };
    return [
      new THREE.MeshBasicMaterial(common),
      new THREE.MeshBasicMaterial({ ...common, transparent: true, opacity: 0.25, depthTest: false, depthWrite: false }),
    ].map((material) => Object.assign(new THREE.Mesh(shape, material), { frustumCulled: false }));
  }

  function describe() {
    $("#descr").textContent = told.descr;
    const [west, south, east, north] = told.bounds;
    const rows = [
      ["size", `${number(east - west, 6)} × ${number(north - south, 6)} m`],
      ["from", `${number(west, 6)}, ${number(south, 6)}`],
      ["heights", `${number(told.heights[0], 3)} to ${number(told.heights[1], 3)} m`],
      ["elements", `${told.elements_total.toLocaleString("en")}`],
      ["faces", facesSaid()],
      ["heights are within", `${short(told.error)} m${told.measured ? ", as far as measured" : ""}`],
      ["slopes are within", `${short(told.slope_error)}° at 99 of 100 places`],
    ];
    if (told.wall_offset > told.steps[0]) rows.push(["walls of discs and ruts within", `${short(told.wall_offset)} m`]);
    if (told.left_out) rows.push(["left out", `${counted(told.left_out, "element")}; heights change by up to ${short(told.change)} m`]);
    for (const sentence of told.hidden) rows.push(["not shown", sentence]);
    if (told.grid) {
      const [down, across, step] = told.grid;
      rows.push(["drawn from", `a grid of ${down.toLocaleString("en")} × ${across.toLocaleString("en")} heights, as there is too much for a mesh. Walls are as wide as a step: ${short(step)} m`]);
    }
    if (told.crs) rows.push(["crs", told.crs]);
    if (told.map) rows.push(["vehicle", told.map.vehicle]);
    list($("#facts dl"), rows);
  }

  function facesSaid() {
    const { ground_faces: tops, under_faces: down, block_faces: block } = told;
    const shown = ground.faces - block, said = (count) => count.toLocaleString("en");
    return `${said(shown)}, ${said(shown - tops - down)} of walls${down ? `, ${said(down)} of undersides` : ""}`;
  }

  function counted(count, noun) {
    return `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
  }

  function list(box, rows) {
    box.replaceChildren(...rows.flatMap(([term, text, key]) => [
      element("dt", { textContent: term }), tagged(element("dd", { textContent: text }), key)]));
  }

  function tagged(node, key) {
    if (key) node.dataset.key = key;
    return node;
  }

  /** A bound, rounded up to two digits. */
  function short(value) {
    if (!(value > 0)) return "0";
    const unit = 10 ** (Math.floor(Math.log10(value)) - 1);
    return number(Math.ceil(value / unit - 1e-9) * unit, 9);
  }

  // --- what is under the pointer --------------------------------------------------------------------

  const digits = () => {
    const [west, south, east, north] = told.bounds;
    return {
      plane: Math.max(0, Math.ceil(-Math.log10(Math.max(east - west, north - south) / 1e5))),
      z: Math.min(4, Math.max(0, Math.ceil(-Math.log10(told.error)))),
    };
  };

  /** What a pixel shows: a place of the ground with rounded x and y, or of a wall; null for none. */
  function probe(px, py) {
    if (!ground) return null;
    const [width, height] = size(), camera = place();
    const ray = new THREE.Raycaster();
    ray.setFromCamera({ x: 2 * px / width - 1, y: 1 - 2 * py / height }, camera);
    const tall = root.scale.z;
    // where rays are parallel they begin before all of it
    const origin = ray.ray.origin.clone(), direction = ray.ray.direction;
    if (eye.parallel) origin.addScaledVector(direction, -4 * radius() - eye.distance);
    const o = [origin.x, origin.y, origin.z / tall], d = [direction.x, direction.y, direction.z / tall];
    const hit = ground.meets(o, d, cut - told.origin[2]);
    if (!hit) return null;
    const facing = ground.facing(hit.face);
    if (cut < Infinity && facing.reduce((sum, value, axis) => sum + value * d[axis], 0) > 0) return null; // inside
    const at = o.map((value, axis) => value + hit.t * d[axis]);
    const kind = ground.kind(hit.face);
    if (kind === "block") return null;
    if (kind === "wall") return wall(hit.face, at, facing);
    const world = at.map((value, axis) => value + told.origin[axis]);
    if (kind === "underside") {
      const below = Math.max(...ground.heights(at[0], at[1]).filter((z) => z <= at[2]));
      const clear = Number.isFinite(below) ? at[2] - below : null;
      return { x: world[0], y: world[1], z: world[2], face: hit.face, under: true, clear };
    }
    const plane = digits().plane;
    const [x, y] = [0, 1].map((axis) => Number(world[axis].toFixed(plane)));
    return on(x, y, at[2]) || on(world[0], world[1], at[2]);
  }

  /** The top at a place of the world that is nearest to a height of the mesh. */
  function on(x, y, near) {
    const local = [x - told.origin[0], y - told.origin[1]];
    const found = ground.under(...local, near);
    if (!found) return null;
    const { z, slope } = ground.at({ face: found.face, weights: ground.weights(found.face, ...local) });
    return { x, y, z: z + told.origin[2], slope, face: found.face };
  }

  /** A place of a wall: it stands between the heights on its two sides, or below what it ends. */
  function wall(face, at, facing) {
    const [west, south, east, north] = told.bounds;
    const beside = 16 * told.steps[0] + 1e-6 * Math.max(east - west, north - south);
    const [behind, before] = [-1, 1].map((sign) => [0, 1].map((axis) => at[axis] + sign * beside * facing[axis]));
    const [over, below, bottom] = told.storeys
      ? [ground.heights(...behind).filter((z) => z >= at[2] - told.error),
        ground.heights(...before).filter((z) => z <= at[2] + told.error),
        ground.heights(...behind, true).filter((z) => z <= at[2] + told.error)]
      : [ground.heights(...behind), ground.heights(...before), []];
    const heights = [Math.min(...over), Math.max(...below, ...bottom)]
      .map((z) => (Number.isFinite(z) ? z + told.origin[2] : null));
    return {
      x: at[0] + told.origin[0], y: at[1] + told.origin[1], z: at[2] + told.origin[2],
      face, wall: heights,
    };
  }

  function verdictAt({ x, y, face }, codes) {
    if (!told.map || (told.raised && told.raised[face])) return "";
    const { west, south, resolution, width, height, classes } = told.map;
    const column = Math.floor((x - west) / resolution), row = Math.floor((y - south) / resolution);
    if (column < 0 || row < 0 || column >= width || row >= height) return "";
    return classes[codes[row * width + column]].name;
  }

  function where(chain) {
    return [...chain].reverse().map((index) => {
      const [file, line] = told.places[index];
      return `${told.files[file]}:${line}`;
    });
  }

  function say(found) {
    const box = $("#readout");
    if (!found) {
      box.replaceChildren();
      return;
    }
    const { plane, z } = digits();
    const index = told.elements[found.face];
    const surface = told.surfaces.at(told.faceSurfaces[found.face]);
    const rows = [row(
      ["x", number(found.x, plane)], ["y", number(found.y, plane)],
      ["z", found.exact ? number(found.z, 9) : found.z.toFixed(z)],
      ["±", found.exact ? "" : short(told.error)],
    )];
    if (found.wall) {
      const [above, below] = found.wall.map((height) => (height === null ? "no ground" : height.toFixed(z)));
      rows.push(row(["wall", `from ${below} to ${above}`]));
    } else if (found.under) {
      rows.push(row(["underside", found.clear === null ? "over nothing" : `${found.clear.toFixed(z)} m clear`]));
    } else {
      rows.push(row(["slope", `${found.slope.toFixed(1)}°`], ["verdict", verdictAt(found, told.verdict)],
        ["worst heading", verdictAt(found, told.worst)]));
    }
    const name = found.exact ? found.exact.surface : surface.name;
    const soil = (told.surfaces.find((one) => one.name === name) || surface).soil;
    rows.push(row(["surface", name || "none"], ["soil", soil.map((pair) => pair.join(" ")).join(", ")]));
    const path = found.exact ? found.exact.element : told.names[index];
    if (path) {
      rows.push(row(["element", path]));
      rows.push(row(["descr", found.exact ? found.exact.descr : told.descrs[index]],
        ["line", found.exact ? found.exact.line : where(told.chains[index])[0]]));
    } else rows.push(row(["element", "none"]));
    box.replaceChildren(...rows.filter((one) => one.childNodes.length));
    box.dataset.exact = found.exact ? "yes" : "no";
  }

  function row(...pairs) {
    const line = element("div");
    for (const [key, text] of pairs) {
      if (text === "" || text === undefined || text === null) continue;
      if (line.childNodes.length) line.append(" ");
      const label = { descr: "", line: "", soil: "", element: "", wall: "wall " }[key] ?? `${key} `;
      line.append(element("span", { className: "soft", textContent: label }));
      const plain = key === "soil" || key === "line" || key === "±";
      line.append(tagged(element(plain ? "span" : "b", { textContent: text }), key));
    }
    return line;
  }

  /** Ask the field itself, where there is one to ask. */
  async function ask(found) {
    if (!live || !found || found.wall || found.under) return;
    const mine = exact = {};
    const below = told.storeys ? `&below=${found.z + 2 * told.error}` : "";
    const answer = await fetch(`values?x=${found.x}&y=${found.y}${below}`).then((a) => (a.ok ? a.json() : null), () => null);
    if (mine !== exact || !answer || answer.picture !== picture || answer.z === null) return;
    say({ ...found, z: answer.z, slope: answer.slope, exact: answer });
  }

  function pick(index) {
    picked = index;
    if (mark) {
      root.remove(mark);
      mark.children.forEach((child) => child.geometry.dispose());
      mark = null;
    }
    $("#picked").hidden = index === null;
    if (index === null) {
      draw();
      return;
    }
    const faces = [];
    for (let face = 0; face < ground.faces; face += 1) {
      if (told.elements[face] === index) for (let k = 0; k < 3; k += 1) faces.push(told.corners[3 * face + k]);
    }
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", geometry.attributes.position);
    shape.setIndex(faces);
    const fill = new THREE.MeshBasicMaterial({
      color: MARK, transparent: true, opacity: 0.35, side: THREE.DoubleSide, depthWrite: false });
    mark = new THREE.Group();
    mark.add(new THREE.Mesh(shape, fill), rim(faces));
    mark.children.forEach((child) => { child.frustumCulled = false; });
    root.add(mark);
    const chain = told.chains[index], own = chain[chain.length - 1];
    const surface = told.surfaces.at(told.faceSurfaces[told.elements.indexOf(index)]);
    const rows = [["path", told.names[index] || "none", "path"]];
    if (told.descrs[index]) rows.push(["descr", told.descrs[index], "descr"]);
    if (chain.length) rows.push(["line", where(chain).join(", placed by "), "line"]);
    rows.push(["wears", [surface.name || "no surface", ...surface.soil.map((pair) => pair.join(" "))].join(", "), "wears"]);
    for (const [key, value] of Object.entries(told.keys[own] || {})) {
      if (key !== "descr") rows.push([key, typeof value === "string" ? value : JSON.stringify(value), `key-${key}`]);
    }
    list($("#picked dl"), rows);
    draw();
  }

  /** The edges that only one of some faces has. */
  function rim(faces) {
    const p = ground.points, seen = new Map();
    const name = (wedge) => `${p[3 * wedge]} ${p[3 * wedge + 1]} ${p[3 * wedge + 2]}`;
    for (let i = 0; i < faces.length; i += 1) {
      const [a, b] = [faces[i], faces[i % 3 === 2 ? i - 2 : i + 1]];
      const [from, to] = [name(a), name(b)];
      const key = from < to ? `${from},${to}` : `${to},${from}`;
      seen.set(key, seen.has(key) ? null : [a, b]);
    }
    const ends = [...seen.values()].filter(Boolean).flat();
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", geometry.attributes.position);
    shape.setIndex(ends);
    return new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color: MARK }));
  }

  // --- pointers and keys ------------------------------------------------------------------------------

  const pointers = new Map();
  let moved = 0, latest = null, resting = 0;

  function spot(event) {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  function hover(px, py) {
    const found = probe(px, py);
    say(found);
    exact = null;
    clearTimeout(resting);
    resting = setTimeout(() => ask(found), 60);
    return found;
  }

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, spot(event));
    moved = pointers.size > 1 ? Infinity : 0;
  });

  canvas.addEventListener("pointermove", (event) => {
    const now = spot(event);
    if (!pointers.has(event.pointerId)) {
      if (latest === null) requestAnimationFrame(() => {
        const [x, y] = latest;
        latest = null;
        hover(x, y);
      });
      latest = now;
      return;
    }
    const before = pointers.get(event.pointerId);
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    moved += Math.hypot(dx, dy);
    if (pointers.size === 1) {
      if (moved < 4) return;
      if (event.buttons & 6 || event.shiftKey || event.ctrlKey) shift(dx, dy);
      else turn(dx * -0.4, dy * 0.4);
      pointers.set(event.pointerId, now);
      return;
    }
    const [other] = [...pointers].find(([id]) => id !== event.pointerId).slice(1);
    const [was, is] = [[before, other], [now, other]].map(([a, b]) => ({
      far: Math.hypot(a[0] - b[0], a[1] - b[1]), angle: Math.atan2(a[1] - b[1], a[0] - b[0]),
      x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2,
    }));
    pointers.set(event.pointerId, now);
    shift(is.x - was.x, is.y - was.y);
    if (is.far > 0) zoom(was.far / is.far, is.x, is.y);
    eye.azimuth += Math.atan2(Math.sin(is.angle - was.angle), Math.cos(is.angle - was.angle)) * 180 / Math.PI;
    draw();
  });

  for (const kind of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(kind, (event) => {
      const known = pointers.delete(event.pointerId);
      if (kind === "pointerup" && known && moved < 4 && event.button === 0) choose(...spot(event));
    });
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerleave", () => { if (!pointers.size && !live) latest = latest; });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines_ = event.deltaMode === 1 ? 30 : 1;
    zoom(1.0015 ** Math.max(-400, Math.min(400, event.deltaY * lines_)), ...spot(event));
  }, { passive: false });

  function choose(px, py) {
    const found = hover(px, py);
    pick(found ? told.elements[found.face] : null);
  }

  function turn(degrees, up) {
    eye.azimuth = (eye.azimuth + degrees + 360) % 360;
    eye.elevation = Math.min(90, Math.max(-20, eye.elevation + up));
    eye.parallel = eye.fitted = false;
    draw();
  }

  function shift(dx, dy) {
    const { right, up } = axes(), scale = perPixel();
    eye.target.addScaledVector(right, -dx * scale).addScaledVector(up, dy * scale);
    eye.fitted = false;
    draw();
  }

  /** Make all smaller by a factor; what is at a pixel stays there. */
  function zoom(factor, px, py) {
    const [width, height] = size(), { right, up } = axes(), scale = perPixel();
    const next = Math.min(Math.max(eye.distance * factor, radius() * 1e-4), radius() * 50);
    const rest = 1 - next / eye.distance;
    eye.target.addScaledVector(right, (px - width / 2) * scale * rest);
    eye.target.addScaledVector(up, (height / 2 - py) * scale * rest);
    eye.distance = next;
    eye.fitted = false;
    draw();
  }

  function choose_layer(name) {
    layer = name;
    $(`#layers input[value="${name}"]`).checked = true;
    paint();
  }

  function stretch(value) {
    const factor = Number((20 ** (value / 100)).toPrecision(2));
    eye.target.z *= factor / root.scale.z;
    root.scale.z = factor;
    $("#exaggeration output").textContent = String(factor);
    $("#exaggeration input").value = String(value);
    draw();
  }

  /** Show nothing above a share of all heights, 0 to 100; all of them at 100. */
  function slice(value) {
    const [low, high] = told.heights, whole = value >= 100;
    cut = whole ? Infinity : low + (high - low) * value / 100;
    renderer && (renderer.clippingPlanes = whole ? [] : [cutting]);
    inside.visible = !whole;
    $("#cut input").value = String(value);
    $("#cut output").textContent = whole ? "" : `${number(cut, 2)} m`;
    draw();
  }

  const keys = {
    "[": () => told.storeys && slice(Math.max(0, Number($("#cut input").value) - 2)),
    "]": () => told.storeys && slice(Math.min(100, Number($("#cut input").value) + 2)),
    t: () => look("top"), n: () => look("north"), e: () => look("east"), s: () => look("south"),
    w: () => look("west"), 0: () => look("home"), Home: () => look("home"),
    "+": () => zoom(0.8, ...middle()), "=": () => zoom(0.8, ...middle()), "-": () => zoom(1.25, ...middle()),
    "<": () => stretch(Math.max(0, Number($("#exaggeration input").value) - 5)),
    ">": () => stretch(Math.min(100, Number($("#exaggeration input").value) + 5)),
    Escape: () => { pick(null); say(null); $("#cross").hidden = true; },
    l: () => {
      const names = [...document.querySelectorAll("#layers label:not([hidden]) input")].map((one) => one.value);
      choose_layer(names[(names.indexOf(layer) + 1) % names.length]);
    },
  };
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const middle = () => size().map((side) => side / 2);

  addEventListener("keydown", (event) => {
    if (!told || event.ctrlKey || event.metaKey || event.altKey) return;
    const on_view = event.target === canvas || event.target === document.body;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (arrows[key] && on_view) {
      const [x, y] = arrows[key];
      if (event.shiftKey) shift(-40 * x, 40 * y);
      else turn(5 * x, 5 * y);
    } else if ((key === "Enter" || key === " ") && on_view) {
      $("#cross").hidden = false;
      choose(...middle());
    } else if (keys[key] && (on_view || event.target.type !== "range" || key === "Escape")) {
      keys[key]();
    } else return;
    event.preventDefault();
  });

  document.querySelectorAll("#layers input").forEach((one) => one.addEventListener("change", () => choose_layer(one.value)));
  document.querySelectorAll("#views button").forEach((one) => one.addEventListener("click", () => look(one.dataset.view)));
  $("#exaggeration input").addEventListener("input", (event) => stretch(Number(event.target.value)));
  $("#cut input").addEventListener("input", (event) => slice(Number(event.target.value)));
  $("#lines input").addEventListener("change", (event) => { lines.visible = event.target.checked; draw(); });
  $("#unpick").addEventListener("click", () => { pick(null); canvas.focus(); });
  $("#handle").addEventListener("click", () => {
    const open = $("#handle").getAttribute("aria-expanded") !== "true";
    $("#handle").setAttribute("aria-expanded", String(open));
  });
  new ResizeObserver(() => (eye.fitted ? fit() : draw())).observe(canvas);
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    busy("The graphics card let go of the picture. Load the page again.");
  });

  // --- a page that follows a file ------------------------------------------------------------------------

  function complain(state) {
    const box = $("#broken"), listed = state.findings || [];
    box.hidden = !listed.length;
    $("#broken h2").textContent = state.picture
      ? "This picture is of the last version without errors" : "There is no version without errors yet";
    $("#broken ol").replaceChildren(...listed.map((one) => {
      const item = element("li"), at = one.line ? `${one.file}:${one.line}:${one.column} ` : "";
      item.append(element("b", { textContent: `${at}${one.code} ` }), one.message, " ",
        element("span", { className: "hint", textContent: one.hint }));
      return item;
    }));
    document.body.dataset.version = String(state.version);
  }

  async function follow() {
    let version = 0;
    for (;;) {
      let crowded = false;
      const taken = (one) => (crowded ||= one.status === 503, one.ok);
      const state = await fetch(`state?after=${version}`).then((one) => taken(one) && one.json()).catch(() => null);
      const fresh = state && state.picture && state.picture !== picture;
      const scene = fresh ? await fetch("scene").then((one) => taken(one) && one.arrayBuffer()).catch(() => null) : null;
      if (!state || (fresh && !scene)) {
        busy(crowded ? "There are too many pages. Close some of them." : "terratool has ended. The picture stays as it is.");
        await new Promise((go) => setTimeout(go, 1000));
        continue;
      }
      if (scene) {
        show(await unpack(scene));
        picture = state.picture;
      }
      complain(state);
      busy(told || state.findings.length ? "" : "Opening…");
      version = state.version;
    }
  }

  (live ? follow() : unpack(embedded()).then(show)).catch((error) => {
    console.error(error);
    busy(`The terrain cannot be shown: ${error.message}`);
  });
})();
