// What wholebody adds to meshcat's viewer: its own light, ground and background, labels, a camera that is aimed,
// commands carried out strictly in order, and a bar to play and scrub a motion.
"use strict";
(function () {
  const THREE = MeshCat.THREE;
  const pane = document.getElementById("meshcat-pane");
  const viewer = new MeshCat.Viewer(pane, pane.dataset.still === undefined); // a page for pictures draws when asked to
  const handle_meshcat = viewer.handle_command.bind(viewer);
  const labels = new Map();
  // What faces away from the sun has no light of it, in shadow or not: only the rest asks for the 16 depths around it.
  const light = THREE.ShaderChunk.lights_fragment_begin;
  THREE.ShaderChunk.lights_fragment_begin = light.replace("all( bvec2( directLight.visible, receiveShadow ) ) ? getShadow( d",
    "receiveShadow && dot( geometry.normal, directLight.direction ) > 0.0 ? getShadow( d");
  const page = { ready: false, seek: seek, play: play, bytes: bytes, resize: resize, capture: capture };
  window.viewer = viewer;
  window.wholebody = page;

  // meshcat lets everything throw a shadow; ghosts and the floor should not.
  const put = viewer.set_object.bind(viewer);
  const markers = new Map(); // arrows, balls and rods, which are as large in every picture
  viewer.set_object = function (path, object) {
    if (object.userData && object.userData.shadow === false) object.castShadow = false;
    if (object.userData && object.userData.scales) markers.set(path.join("/"), object);
    put(path, object);
  };

  // meshcat's world is z up; three's is y up, and the scene is turned to match.
  const three = p => new THREE.Vector3(p[0], p[2], -p[1]);

  function set_up_scene() {
    for (const name of ["SpotLight", "PointLightNegativeX", "PointLightPositiveX", "AmbientLight", "FillLight"]) {
      viewer.scene_tree.find(["Lights", name, "<object>"]).object.visible = false;
    }
    const sky = new THREE.HemisphereLight(0xffffff, 0xb9b2a8, 0.72);
    sky.position.set(0, 0, 1);
    viewer.set_object(["Lights", "Sky"], sky);
    const sun = new THREE.DirectionalLight(0xfff6e8, 0.42);
    sun.position.set(2.2, -1.6, 4.5);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    Object.assign(sun.shadow.camera, { left: -3, right: 3, top: 3, bottom: -3, near: 0.5, far: 12 });
    sun.shadow.bias = -0.0004;
    sun.shadow.normalBias = 0.012;
    sun.shadow.radius = 3;
    viewer.set_object(["Lights", "Sun"], sun);
    const fill = new THREE.DirectionalLight(0xdfe8ff, 0.16);
    fill.position.set(-2, 2.5, 1.5);
    viewer.set_object(["Lights", "Fill"], fill);

    viewer.set_property(["Background"], "top_color", [0.96, 0.97, 0.98]);
    viewer.set_property(["Background"], "bottom_color", [0.80, 0.83, 0.86]);
    viewer.scene_tree.find(["Axes"]).object.visible = false;
    const grid = new THREE.GridHelper(6, 12, 0xa3a9b0, 0xbcc1c7);
    grid.rotateX(Math.PI / 2);
    viewer.set_object(["Grid"], grid);
    viewer.set_transform(["Grid"], [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0.0015, 1]);
    const shade = new THREE.Mesh(new THREE.PlaneGeometry(6, 6), new THREE.ShadowMaterial({ opacity: 0.18 }));
    shade.receiveShadow = true;
    shade.renderOrder = -1;
    viewer.set_object(["Ground"], shade);
  }

  // A sprite of constant size on the screen: dark text on a light plate, always in front.
  function label(cmd) {
    const unit = 44, pad = 18;
    const canvas = document.createElement("canvas");
    let ctx = canvas.getContext("2d");
    const font = `500 ${unit}px "Helvetica Neue", Arial, "DejaVu Sans", sans-serif`;
    ctx.font = font;
    const width = Math.ceil(ctx.measureText(cmd.text).width) + 2 * pad, height = unit + 22;
    canvas.width = width;
    canvas.height = height;
    ctx = canvas.getContext("2d");
    ctx.font = font;
    ctx.fillStyle = "rgba(255,255,255,0.82)";
    const r = 16;
    ctx.beginPath();
    ctx.moveTo(r, 0);
    ctx.arcTo(width, 0, width, height, r);
    ctx.arcTo(width, height, 0, height, r);
    ctx.arcTo(0, height, 0, 0, r);
    ctx.arcTo(0, 0, width, 0, r);
    ctx.fill();
    ctx.fillStyle = cmd.color;
    ctx.textBaseline = "middle";
    ctx.fillText(cmd.text, pad, height / 2 + 2);
    const texture = new THREE.CanvasTexture(canvas);
    texture.minFilter = THREE.LinearFilter;
    texture.generateMipmaps = false;
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial(
      { map: texture, depthTest: false, depthWrite: false, transparent: true, sizeAttenuation: false }));
    sprite.renderOrder = 20;
    sprite.userData = { text: cmd.text, size: cmd.size, slender: width / height };
    labels.set(cmd.path, sprite);
    viewer.set_object(cmd.path.split("/").filter(x => x), sprite);
  }

  // The title, one line about the picture, and the meaning of its colours.
  let panel_message = null;
  function panel(cmd) {
    panel_message = cmd;
    const box = document.getElementById("panel");
    const line = (kind, text) => {
      const made = document.createElement(kind);
      made.textContent = text;
      box.appendChild(made);
      return made;
    };
    box.replaceChildren();
    box.style.display = "block";
    line("b", cmd.title);
    line("span", cmd.status);
    for (const [meaning, red, green, blue] of cmd.legend) {
      const patch = document.createElement("i");
      patch.style.background = `rgb(${red}, ${green}, ${blue})`;
      line("span", meaning).prepend(patch);
    }
  }

  // Bones follow nodes of the scene; some turn half way between two others. Bodies are bent by them.
  const skeletons = new Map();
  const parts = path => path.split("/").filter(x => x);
  const numbers = (Kind, bytes) => new Kind(new Uint8Array(bytes).buffer);
  // Sent are the differences between neighbours, which are small; the sums go round as whole numbers do.
  const summed = (values, stride) => {
    for (let at = stride; at < values.length; at++) values[at] += values[at - stride];
    return values;
  };
  const matrices = bytes => {
    const values = numbers(Float32Array, bytes), found = [];
    for (let at = 0; at < values.length; at += 16) found.push(new THREE.Matrix4().fromArray(values, at));
    return found;
  };

  function skeleton(cmd) {
    const nodes = cmd.carriers.map(path => viewer.scene_tree.find(parts(path)).object);
    const offsets = matrices(cmd.offsets);
    const made = new THREE.Skeleton(nodes.map(() => new THREE.Bone()), matrices(cmd.inverses));
    const first = new THREE.Quaternion(), second = new THREE.Quaternion();
    const at = new THREE.Vector3(), size = new THREE.Vector3(), nowhere = new THREE.Vector3();
    const up = new THREE.Vector3(), other = new THREE.Vector3(), down = new THREE.Vector3(0, 0, -1);
    const turn = new THREE.Quaternion(), swing = new THREE.Quaternion(), twist = new THREE.Quaternion();
    const update = made.update.bind(made);
    made.update = function () {
      nodes.forEach((node, k) => made.bones[k].matrixWorld.multiplyMatrices(node.matrixWorld, offsets[k]));
      for (const [half, from, to, x, y, z, share, twists, ...aside] of cmd.halves) {
        made.bones[from].matrixWorld.decompose(nowhere, first, size);
        made.bones[to].matrixWorld.decompose(at, second, size);
        const bent = 1 - up.set(0, 0, 1).applyQuaternion(first).dot(other.set(0, 0, 1).applyQuaternion(second));
        if (aside.length) {
          turn.copy(first).invert().multiply(second);
          up.fromArray(aside);
          swing.setFromUnitVectors(up, other.copy(down).applyQuaternion(turn));
          swing.multiply(twist.setFromUnitVectors(down, up));
          twist.copy(swing).invert().multiply(turn);
          second.copy(first).multiply(swing).multiply(turn.identity().slerp(twist, twists));
        }
        first.slerp(second, share);
        at.add(up.set(x, y, z).multiply(size).multiplyScalar(bent).applyQuaternion(first));
        made.bones[half].matrixWorld.compose(at, first, size);
      }
      update();
    };
    skeletons.set(cmd.path, made);
  }

  const SMALL = 0.0035; // m: of a pixel where the camera looks at, from which bodies are drawn coarsely
  const USUAL = 2.4; // m: height of the picture in which markers have the size in which they are made
  let small = false;
  function measure() {
    const distance = viewer.camera.position.distanceTo(viewer.controls.target);
    const across = 2 * distance * Math.tan(viewer.camera.fov * Math.PI / 360);
    small = across / viewer.renderer.domElement.height > SMALL;
    const size = Math.min(Math.max(across / USUAL, 0.15), 3);
    for (const [path, marker] of markers) {
      if (!marker.parent) markers.delete(path);
      else marker.scale.set(...marker.userData.scales.map(scaled => scaled ? size : 1));
    }
  }

  // Around a contact a body takes the colour of its state. Where contacts are is told by their markers.
  const spots = { value: Array.from({ length: 64 }, () => new THREE.Vector4()) }, spot_count = { value: 0 };
  function find_contacts() {
    const folder = viewer.scene_tree.children.contacts;
    spot_count.value = 0;
    for (const { children } of Object.values(folder ? folder.children : {})) {
      if (!children.a || !children.a.object.visible || spot_count.value === spots.value.length) continue;
      const at = new THREE.Vector3().setFromMatrixPosition(children.a.object.matrixWorld);
      const overlaps = children.depth && children.depth.object.visible;
      spots.value[spot_count.value++].set(at.x, at.y, at.z, overlaps ? 1 : 0);
    }
  }
  function paint_contacts(material, look) {
    const color = rgb => `vec3(${rgb.map(part => part.toFixed(4)).join(", ")})`;
    material.onBeforeCompile = shader => {
      Object.assign(shader.uniforms, { spots, spot_count });
      shader.vertexShader = "varying vec3 seen_at;\n" + shader.vertexShader.replace("#include <project_vertex>",
        "#include <project_vertex>\n  seen_at = (modelMatrix * vec4(transformed, 1.0)).xyz;");
      shader.fragmentShader = `varying vec3 seen_at;
        uniform vec4 spots[${spots.value.length}];
        uniform int spot_count;
      ` + shader.fragmentShader.replace("#include <color_fragment>", `#include <color_fragment>
        vec2 near = vec2(0.0);
        for (int k = 0; k < ${spots.value.length}; k++) {
          if (k >= spot_count) break;
          float share = 1.0 - smoothstep(${(0.7 * look.radius).toFixed(4)}, ${look.radius.toFixed(4)},
                                         distance(seen_at, spots[k].xyz));
          near = max(near, share * vec2(1.0, spots[k].w));
        }
        diffuseColor.rgb = mix(diffuseColor.rgb, mix(${color(look.touch)}, ${color(look.overlap)}, near.y),
                               ${look.share.toFixed(4)} * near.x);`);
    };
  }

  function skin(cmd) {
    const shape = new THREE.BufferGeometry();
    const position = Float32Array.from(summed(numbers(Int16Array, cmd.position), 3), x => x * cmd.unit);
    shape.setAttribute("position", new THREE.BufferAttribute(position, 3));
    const normal = Float32Array.from(summed(numbers(Int8Array, cmd.normal), 3), x => x / 127);
    shape.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    shape.setAttribute("skinIndex", new THREE.BufferAttribute(numbers(Uint8Array, cmd.bones), 4));
    shape.setAttribute("skinWeight", new THREE.BufferAttribute(numbers(Uint8Array, cmd.weights), 4, true));
    shape.setIndex(new THREE.BufferAttribute(summed(numbers(Uint16Array, cmd.index), 1), 1));
    const [r, g, b, alpha] = cmd.color;
    const material = new THREE.MeshPhongMaterial({
      color: new THREE.Color(r, g, b), opacity: alpha, transparent: alpha < 1, shininess: 10, specular: 0x141414,
      polygonOffset: alpha < 1, polygonOffsetFactor: 2, polygonOffsetUnits: 8,
    });
    if (alpha === 1) paint_contacts(material, cmd.contacts);
    const mesh = new THREE.SkinnedMesh(shape, material);
    // Shadows are thrown by the coarse triangles, which follow the fine ones; so is a body drawn that is small.
    const coarse = shape.index.count - cmd.fine, fewer = () => shape.setDrawRange(cmd.fine, coarse);
    mesh.onBeforeRender = () => {
      if (!small) shape.setDrawRange(0, cmd.fine);
    };
    mesh.onAfterRender = fewer;
    fewer();
    mesh.frustumCulled = false; // its box is that of the binding posture
    mesh.castShadow = mesh.receiveShadow = alpha === 1;
    mesh.bind(skeletons.get(cmd.skeleton), new THREE.Matrix4());
    viewer.set_object(parts(cmd.path), mesh);
  }

  // Boxes on the screen around hands and heads: their joints, half sizes and how far above the joints they are, m.
  const GUARDED = [["wrist", 0.17, 0], ["neck2_rotation", 0.14, 0.09]];
  const CLOSE = 0.5; // of half the screen's height, from which a hand is all that is looked at
  function guarded(up) {
    const figure = viewer.scene_tree.children.figure, found = [];
    const eye = new THREE.Vector3().setFromMatrixPosition(viewer.camera.matrixWorld);
    for (const [name, node] of Object.entries(figure ? figure.children : {})) {
      const [, half, lift] = GUARDED.find(([joint]) => name.includes(joint)) || [];
      if (!half) continue;
      const at = new THREE.Vector3(0, 0, lift).applyMatrix4(node.object.matrixWorld);
      const size = half / (eye.distanceTo(at) * up);
      at.project(viewer.camera);
      const box = { x: at.x, w: 2 * size / viewer.camera.aspect, bottom: at.y - size, h: 2 * size, hand: true };
      if (size < CLOSE) found.push(box);
    }
    return found;
  }

  // Puts labels, the lower ones first, where they hide no hands, heads and other labels: up or down to the nearest free
  // place. None leaves the picture, and none is too small to be read.
  const LEAST = 15; // pixels: height of a label
  function arrange() {
    const up = Math.tan(viewer.camera.fov * Math.PI / 360);
    const least = 2 * up * LEAST / viewer.renderer.getSize(new THREE.Vector2()).y;
    viewer.camera.updateProjectionMatrix(); // meshcat does so later, in drawing
    viewer.camera.updateMatrixWorld();
    viewer.scene.updateMatrixWorld();
    const found = [];
    for (const [path, sprite] of labels) {
      let top = sprite, seen = true;
      for (; top.parent; top = top.parent) seen = seen && top.visible;
      if (top !== viewer.scene) labels.delete(path);
      const at = new THREE.Vector3().setFromMatrixPosition(sprite.matrixWorld).project(viewer.camera);
      if (top !== viewer.scene || !seen || at.z > 1) continue;
      const high = Math.max(sprite.userData.size, least), w = sprite.userData.slender * high / (up * viewer.camera.aspect);
      sprite.scale.set(sprite.userData.slender * high, high, 1);
      const x = Math.min(Math.max(at.x, w / 2 - 1), 1 - w / 2);
      found.push({ sprite, aside: (at.x - x) / w, x, y: at.y, w, h: high / up });
    }
    found.sort((a, b) => a.y - b.y);
    const placed = guarded(up);
    for (const item of found) {
      const start = item.y + 0.4 * item.h, free = bottom => bottom > -1 && bottom + item.h < 1
        && !placed.some(p => Math.abs(p.x - item.x) < (p.w + item.w) / 2
                             && p.bottom < bottom + item.h && bottom < p.bottom + p.h);
      const steps = [...Array(48).keys()].map(k => start + (k % 2 ? 0.25 : -0.25) * Math.ceil(k / 2) * item.h);
      const near = steps.find(free), bottom = near === undefined ? start : near;
      placed.push({ x: item.x, w: item.w, bottom, h: item.h });
      item.sprite.center.set(0.5 + item.aside, (item.y - bottom) / item.h);
    }
  }
  const draw = viewer.render.bind(viewer);
  viewer.render = function () {
    measure();
    arrange();
    find_contacts();
    draw();
  };

  // A picture of the drawing, PNG as a data address; with the panel in the corner that hides least of the figure.
  function capture(legend) {
    if (!legend || !panel_message) return viewer.capture_image();
    viewer.render();
    const canvas = document.createElement("canvas"), source = viewer.renderer.domElement;
    [canvas.width, canvas.height] = [source.width, source.height];
    const ctx = canvas.getContext("2d");
    ctx.drawImage(source, 0, 0);
    write_panel(ctx, canvas.width, canvas.height);
    return canvas.toDataURL();
  }

  const LARGEST = 0.45; // of the width and of the height: a panel that needs more is left out
  function write_panel(ctx, width, height) {
    const unit = Math.max(11, Math.round(height / 55)), line = 1.45 * unit, pad = 0.8 * unit, most = LARGEST * width;
    const font = weight => `${weight} ${unit}px "Helvetica Neue", Arial, "DejaVu Sans", sans-serif`;
    const lines = [{ text: panel_message.title, weight: "bold" }];
    const { status, legend } = panel_message;
    for (const text of status ? status.split("; ") : []) lines.push({ text, weight: "normal" });
    for (const [text, ...rgb] of legend) lines.push({ text, weight: "normal", rgb });
    let wide = 0;
    for (const one of lines) {
      ctx.font = font(one.weight);
      wide = Math.max(wide, ctx.measureText(one.text).width + (one.rgb ? 1.4 * unit : 0));
    }
    wide += 2 * pad;
    const high = lines.length * line + 1.2 * pad;
    page.panel = null;
    if (wide > most || high > LARGEST * height) return;
    const [left, top] = free_corner(width, height, wide, high, pad);
    page.panel = [left, top, wide, high];
    ctx.fillStyle = "rgba(255,255,255,0.8)";
    ctx.fillRect(left, top, wide, high);
    ctx.textBaseline = "middle";
    lines.forEach((one, k) => {
      const middle = top + 0.6 * pad + (k + 0.5) * line;
      let x = left + pad;
      if (one.rgb) {
        ctx.fillStyle = `rgb(${one.rgb.join(", ")})`;
        ctx.fillRect(x, middle - 0.4 * unit, 0.8 * unit, 0.8 * unit);
        x += 1.4 * unit;
      }
      ctx.fillStyle = "#333a42";
      ctx.font = font(one.weight);
      ctx.fillText(one.text, x, middle);
    });
  }

  // Left and top of a box in the corner in which the fewest joints, goals and labels are; top left where all are free.
  function free_corner(width, height, wide, high, gap) {
    const found = [], at = new THREE.Vector3();
    const add = object => {
      at.setFromMatrixPosition(object.matrixWorld).project(viewer.camera);
      found.push([(at.x + 1) / 2 * width, (1 - at.y) / 2 * height]);
    };
    for (const folder of ["figure", "goals"]) {
      const node = viewer.scene_tree.children[folder];
      for (const below of Object.values(node ? node.children : {})) add(below.object);
    }
    for (const sprite of labels.values()) add(sprite);
    const right = width - wide - gap, low = height - high - gap, near = 0.06 * height;
    const corners = [[gap, gap], [right, gap], [gap, low], [right, low]];
    const hidden = ([left, top]) => found.filter(([x, y]) =>
      x > left - near && x < left + wide + near && y > top - near && y < top + high + near).length;
    return corners.reduce((best, one) => hidden(one) < hidden(best) ? one : best);
  }

  let drawn = null; // width and height of a page for pictures
  const fit = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = () => drawn ? fit(...drawn) : fit(); // meshcat calls it when the window changes
  viewer.set_3d_pane_size(); // and in the next frame, before which a picture would have a canvas's first size
  function resize(width, height) {
    drawn = [width, height];
    pane.style.display = "none"; // a picture is read from its canvas: nothing of it goes to a screen
    fit(width, height);
  }
  function bytes(text) {
    const letters = atob(text), found = new Uint8Array(letters.length);
    for (let at = 0; at < letters.length; at++) found[at] = letters.charCodeAt(at); // a tenth of Uint8Array.from's time
    return found;
  }

  // Look at a target: from `eye`, or from `direction`, so far away that every one of `points` is in the picture.
  function look(cmd) {
    const target = three(cmd.target);
    const [width, height] = drawn || [window.innerWidth, window.innerHeight];
    const up = Math.tan(cmd.fov * Math.PI / 360), side = up * width / height;
    let eye;
    if (cmd.eye) {
      eye = three(cmd.eye);
    } else {
      const back = three(cmd.direction).normalize();
      const right = new THREE.Vector3(0, 1, 0).cross(back).normalize();
      const above = back.clone().cross(right);
      let distance = 0.3;
      for (let i = 0; i + 2 < cmd.points.length; i += 3) {
        const p = three(cmd.points.slice(i, i + 3)).sub(target);
        const deep = p.dot(back);
        distance = Math.max(distance, deep + cmd.margin * Math.abs(p.dot(right)) / side,
                            deep + cmd.margin * Math.abs(p.dot(above)) / up);
      }
      eye = target.clone().addScaledVector(back, distance);
    }
    const camera = viewer.camera;
    camera.fov = cmd.fov;
    camera.near = 0.02;
    camera.far = 200;
    camera.updateProjectionMatrix();
    camera.position.copy(eye);
    viewer.controls.target.copy(target);
    viewer.controls.update();
    const sun = viewer.scene_tree.find(["Lights", "Sun", "<object>"]).object;
    sun.position.set(cmd.target[0] + 2.2, cmd.target[1] - 1.6, cmd.target[2] + 3.6);
    sun.target.position.set(cmd.target[0], cmd.target[1], cmd.target[2]);
    if (!sun.target.parent) sun.parent.add(sun.target);
  }

  viewer.handle_command = function (cmd) {
    if (cmd.type === "label") label(cmd);
    else if (cmd.type === "look") look(cmd);
    else if (cmd.type === "skeleton") skeleton(cmd);
    else if (cmd.type === "skin") skin(cmd);
    else if (cmd.type === "panel") panel(cmd);
    else handle_meshcat(cmd);
    if (cmd.type === "set_animation") show_bar(cmd.animations.length > 0);
    viewer.set_dirty();
  };

  // Carries out a bundle: every command after its length, in order, in one go.
  page.take = function (bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let at = 0; at < bytes.byteLength;) {
      const size = view.getUint32(at, true);
      viewer.handle_command_bytearray(bytes.subarray(at + 4, at + 4 + size));
      at += 4 + size;
    }
  };

  // meshcat's own seek does nothing before the first play, and interpolates wrongly after the end.
  function seek(time) {
    const animator = viewer.animator;
    animator.playing = false;
    for (const action of animator.actions) {
      action.play();
      action.paused = true;
      action.time = Math.min(action._clip.duration, Math.max(0, time));
    }
    animator.mixer.update(0);
    animator.display_progress(time);
    viewer.set_dirty();
  }

  function play() {
    const animator = viewer.animator;
    const from = animator.time < animator.duration - 1e-6 ? animator.time : 0;
    seek(from);
    for (const action of animator.actions) action.paused = false;
    animator.play();
  }

  const bar = document.getElementById("bar");
  const button = bar.querySelector("button"), slider = bar.querySelector("input"), clock = bar.querySelector("span");
  button.onclick = () => {
    if (viewer.animator.playing) seek(viewer.animator.time);
    else play();
  };
  slider.oninput = () => seek(slider.value * viewer.animator.duration / slider.max);
  function show_bar(on) {
    bar.style.display = on ? "flex" : "none";
  }
  function tick() {
    requestAnimationFrame(tick);
    if (bar.style.display !== "flex") return;
    const animator = viewer.animator;
    button.textContent = animator.playing ? "\u2016" : "\u25b6";
    slider.value = animator.duration ? animator.time / animator.duration * slider.max : 0;
    clock.textContent = `${animator.time.toFixed(2)} / ${animator.duration.toFixed(2)} s`;
  }

  function connect() {
    const socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    let known = false;
    socket.onopen = () => { known = true; };
    socket.onmessage = message => {
      try {
        page.take(new Uint8Array(message.data));
      } finally {
        page.ready = true;
        socket.send("done");
      }
    };
    // The program ended or was started anew: a fresh page gets the fresh picture.
    socket.onclose = () => setTimeout(() => known ? again() : connect(), 1000);
  }
  function again() {
    fetch(location.href).then(() => location.reload(), () => setTimeout(again, 1000));
  }

  // Draws materials like those of scenes, in a small picture. The first drawing of a scene takes a second longer than
  // the next ones, for shaders; a page for pictures compiles them while its scene is still on the way.
  function warm_up(contacts) {
    const box = new THREE.BoxGeometry(0.1, 0.1, 0.1), body = box.clone(), ends = box.attributes.position.count;
    body.setAttribute("skinIndex", new THREE.BufferAttribute(new Uint8Array(4 * ends), 4));
    body.setAttribute("skinWeight", new THREE.BufferAttribute(new Uint8Array(4 * ends).fill(255), 4, true));
    const painted = new THREE.MeshPhongMaterial({ shininess: 10, specular: 0x141414 });
    paint_contacts(painted, contacts);
    const skinned = new THREE.SkinnedMesh(body, painted);
    skinned.bind(new THREE.Skeleton([new THREE.Bone()]), new THREE.Matrix4());
    const opaque = [new THREE.MeshPhongMaterial({ flatShading: true }), new THREE.MeshPhongMaterial()];
    const clear = { transparent: true, opacity: 0.5 };
    const group = new THREE.Group().add(skinned,
      ...opaque.map(material => new THREE.Mesh(box, material)),
      new THREE.Mesh(box, new THREE.MeshPhongMaterial({ ...clear, flatShading: true })),
      new THREE.Mesh(box, new THREE.MeshBasicMaterial({ ...clear, depthTest: false })),
      new THREE.Sprite(new THREE.SpriteMaterial(
        { map: new THREE.CanvasTexture(document.createElement("canvas")), depthTest: false, depthWrite: false, sizeAttenuation: false })));
    group.traverse(one => { one.castShadow = one.receiveShadow = true; });
    viewer.scene.add(group);
    const size = viewer.renderer.getSize(new THREE.Vector2());
    viewer.renderer.setSize(16, 16, false);
    viewer.render();
    viewer.render(); // again, for shadows: in the first drawing they are thrown before three counts its lights
    viewer.renderer.setSize(size.x, size.y, false);
    viewer.scene.remove(group);
  }

  set_up_scene();
  if (pane.dataset.still !== undefined) warm_up(JSON.parse(pane.dataset.still));
  if (window.picture) page.take(window.picture); // of a saved page
  if (window.picture || pane.dataset.still !== undefined) {
    page.ready = true;
  } else {
    connect();
  }
  tick();
})();
