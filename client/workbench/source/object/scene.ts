// One object with its contacts in WebGL. It draws when something has changed, not all the time.
import {
  BufferAttribute, BufferGeometry, Color, ConeGeometry, CylinderGeometry, DirectionalLight, DoubleSide, Group, HemisphereLight, LineBasicMaterial, LineSegments, Mesh as ThreeMesh, MeshLambertMaterial,
  OrthographicCamera, Points, Raycaster, Scene as ThreeScene, ShaderMaterial, SphereGeometry, SRGBColorSpace, Vector3, WebGLRenderer,
} from "three";
import type { RGB } from "../colour";
import type { Mesh } from "./paint";

export interface Contacts { positions: Float32Array; colours: Uint8Array; shown: Uint8Array }
export interface Rod { from: number[]; to: number[]; colour: RGB; width: number; tip?: "ball" | "cone"; tipColour?: RGB }
export interface Line { points: number[]; colour: RGB } // pairs of x, y, z
export interface View { azimuth: number; elevation: number; zoom: number }

const manyPoints = 30000; // beyond this they are squares of few pixels
export const movingPoints = 15000; // that are drawn while the object turns: an even sample; all when it rests

const colourOf = ([r, g, b]: RGB) => new Color().setRGB(r / 255, g / 255, b / 255, SRGBColorSpace);
const vector = ([x, y, z]: number[]) => new Vector3(x, y, z);

// 0 to size - 1; every beginning of it is spread evenly over all.
function evenOrder(size: number): Uint32Array {
  const order = Uint32Array.from({ length: size }, (_, i) => i);
  if (size <= movingPoints) return order;
  let stride = Math.floor(size * 0.6180339887) | 1;
  const common = (a: number, b: number): number => (b ? common(b, a % b) : a);
  while (common(stride, size) !== 1) stride += 2;
  for (let i = 0, at = 0; i < size; ++i, at = (at + stride) % size) order[i] = at;
  return order;
}

export class ObjectScene {
  view: View = { azimuth: 0.9, elevation: 0.45, zoom: 1 };
  onDraw: () => void = () => {};
  private readonly renderer: WebGLRenderer;
  private readonly scene = new ThreeScene();
  private readonly camera = new OrthographicCamera();
  private readonly light = new DirectionalLight(0xffffff, 1.9);
  private readonly rods = new Group();
  private readonly lines = new Group();
  private readonly material = new MeshLambertMaterial({ vertexColors: true, flatShading: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
  private readonly dots = new ShaderMaterial({
    uniforms: { size: { value: 8 }, bias: { value: 0 }, round: { value: 1 } },
    vertexShader: `attribute vec3 tint; attribute float seen; uniform float size; uniform float bias; varying vec4 colour;
      void main() {
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        gl_Position.z -= bias;
        gl_PointSize = seen > 0.5 ? size : 0.55 * size;
        colour = vec4(tint, seen > 0.5 ? 1.0 : 0.25);
        if (position.x != position.x) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
      }`,
    fragmentShader: `uniform float round; varying vec4 colour;
      void main() {
        if (round > 0.5) {
          float r = 2.0 * length(gl_PointCoord - 0.5);
          if (r > 1.0) discard;
          gl_FragColor = vec4(colour.rgb * (r > 0.72 ? 0.62 : 1.0), colour.a);
        } else gl_FragColor = vec4(colour.rgb, 1.0);
      }`,
    transparent: true,
  });
  private mesh: ThreeMesh | null = null;
  private points: Points | null = null;
  private centre = new Vector3();
  private radius = 1;
  private waiting = 0;
  private resting = 0;
  private held = false;
  private order: Uint32Array = new Uint32Array(0); // of the dots: every beginning of it is an even sample

  // Throws where there is no WebGL.
  constructor(readonly canvas: HTMLCanvasElement, many: boolean) {
    // Smooth edges cost four times the pixels; the dots of a large set hide them.
    this.renderer = new WebGLRenderer({ canvas, antialias: !many, alpha: true });
    this.scene.add(new HemisphereLight(0xffffff, 0x8890a0, 1.6), this.light, this.rods, this.lines);
  }

  dispose(): void {
    cancelAnimationFrame(this.waiting);
    clearTimeout(this.resting);
    this.renderer.dispose();
  }

  get size(): number { return 2 * this.radius; }

  // The camera stands where it stood; the object fills the picture.
  setMesh(mesh: Mesh | null, contacts: Float32Array): void {
    if (this.mesh) { this.scene.remove(this.mesh); this.mesh.geometry.dispose(); this.mesh = null; }
    const all = mesh && mesh.positions.length ? mesh.positions : contacts;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < all.length; ++i) {
      if (all[i] < low[i % 3]) low[i % 3] = all[i];
      if (all[i] > high[i % 3]) high[i % 3] = all[i];
    }
    if (low[0] <= high[0]) {
      this.centre.set((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
      this.radius = Math.max(1e-3, 0.5 * Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]));
    }
    if (mesh?.positions.length) {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(mesh.positions, 3));
      geometry.setIndex(new BufferAttribute(mesh.triangles, 1));
      this.mesh = new ThreeMesh(geometry, this.material);
      this.scene.add(this.mesh);
    }
    this.draw();
  }

  paint(colours: Uint8Array): void {
    if (!this.mesh) return;
    const linear = new Float32Array(colours.length);
    for (let i = 0; i < colours.length; ++i) linear[i] = (colours[i] / 255) ** 2.2;
    this.mesh.geometry.setAttribute("color", new BufferAttribute(linear, 3));
    this.draw();
  }

  setContacts(contacts: Contacts): void {
    if (this.points) { this.scene.remove(this.points); this.points.geometry.dispose(); }
    const geometry = new BufferGeometry();
    const size = contacts.shown.length;
    this.order = evenOrder(size);
    const positions = new Float32Array(3 * size);
    const tints = new Uint8Array(3 * size);
    const seen = new Uint8Array(size);
    this.order.forEach((from, at) => {
      for (let k = 0; k < 3; ++k) positions[3 * at + k] = contacts.positions[3 * from + k], tints[3 * at + k] = contacts.colours[3 * from + k];
      seen[at] = contacts.shown[from];
    });
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.setAttribute("tint", new BufferAttribute(tints, 3, true));
    geometry.setAttribute("seen", new BufferAttribute(seen, 1));
    this.points = new Points(geometry, this.dots);
    this.points.frustumCulled = false;
    const many = contacts.shown.length > manyPoints;
    this.dots.uniforms.round.value = many ? 0 : 1;
    this.dots.uniforms.size.value = (many ? 2 : Math.min(11, Math.max(5, 9 * Math.sqrt(400 / (1 + contacts.shown.length))))) * this.renderer.getPixelRatio();
    this.dots.transparent = !many;
    this.scene.add(this.points);
    this.draw();
  }

  // Fingers of the selected touch, arrows of the next touches.
  setRods(rods: Rod[]): void {
    for (const child of this.rods.children) (child as ThreeMesh).geometry.dispose();
    this.rods.clear();
    const add = (geometry: BufferGeometry, colour: RGB) => {
      const made = new ThreeMesh(geometry, new MeshLambertMaterial({ color: colourOf(colour) }));
      this.rods.add(made);
      return made;
    };
    for (const rod of rods) {
      const from = vector(rod.from);
      const to = vector(rod.to);
      const along = to.clone().sub(from);
      const length = along.length();
      if (!(length > 0)) continue;
      const turn = (object: ThreeMesh, at: Vector3) => { object.position.copy(at); object.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), along.clone().normalize()); };
      turn(add(new CylinderGeometry(rod.width, rod.width, length, 10), rod.colour), from.clone().add(to).multiplyScalar(0.5));
      if (rod.tip === "ball") add(new SphereGeometry(2.1 * rod.width, 20, 14), rod.tipColour ?? rod.colour).position.copy(to);
      if (rod.tip === "cone") turn(add(new ConeGeometry(2.8 * rod.width, 7 * rod.width, 14), rod.colour), to.clone().sub(along.clone().setLength(3.5 * rod.width)));
    }
    this.draw();
  }

  // Thin lines: ways, edges of a box.
  setLines(lines: Line[]): void {
    for (const child of this.lines.children) (child as LineSegments).geometry.dispose();
    this.lines.clear();
    for (const { points, colour } of lines) {
      if (!points.length) continue;
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(Float32Array.from(points), 3));
      this.lines.add(new LineSegments(geometry, new LineBasicMaterial({ color: colourOf(colour) })));
    }
    this.draw();
  }

  resize(width: number, height: number): void {
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio || 1));
    this.renderer.setSize(width, height, false);
    this.draw();
  }

  turn(azimuth: number, elevation: number): void {
    this.view.azimuth -= azimuth;
    this.view.elevation = Math.min(1.55, Math.max(-1.55, this.view.elevation + elevation));
    this.draw();
    // All dots come back when it rests.
    this.points?.geometry.setDrawRange(0, movingPoints);
    clearTimeout(this.resting);
    if (!this.held) this.resting = window.setTimeout(() => this.hold(false), 500);
  }

  // While a pointer holds it, it turns.
  hold(held: boolean): void {
    this.held = held;
    if (held || !this.points) return;
    this.points.geometry.setDrawRange(0, Infinity);
    this.draw();
  }

  zoom(factor: number): void {
    this.view.zoom = Math.min(12, Math.max(0.4, this.view.zoom * factor));
    this.draw();
  }

  // The picture as a data URL.
  picture(): string {
    this.drawNow();
    return this.canvas.toDataURL();
  }

  // Onto another canvas, which keeps it: what WebGL has drawn is gone once the browser has shown it.
  copyTo(other: HTMLCanvasElement): void {
    if (!this.canvas.clientWidth) return;
    this.resize(this.canvas.clientWidth, this.canvas.clientHeight);
    this.drawNow();
    Object.assign(other, { width: this.canvas.width, height: this.canvas.height });
    other.getContext("2d")!.drawImage(this.canvas, 0, 0);
  }

  draw(): void {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => { this.waiting = 0; this.drawNow(); });
  }

  private drawNow(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    const { azimuth, elevation, zoom } = this.view;
    const reach = 2.4 * this.radius;
    const away = new Vector3(Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation));
    const half = (0.98 * this.radius) / zoom;
    const aspect = width / height;
    Object.assign(this.camera, { left: -half * Math.max(1, aspect), right: half * Math.max(1, aspect), top: half * Math.max(1, 1 / aspect), bottom: -half * Math.max(1, 1 / aspect), near: 0, far: 4 * reach });
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(this.centre).addScaledVector(away, 2 * reach);
    this.camera.lookAt(this.centre);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    this.light.position.copy(away).add(new Vector3(0, 0, 0.9));
    this.dots.uniforms.bias.value = (2 * 0.03 * this.radius) / (4 * reach);
    this.renderer.render(this.scene, this.camera);
    this.onDraw();
  }

  // Pixels of the picture, and the depth towards the eye.
  project(x: number, y: number, z: number, out = new Vector3()): Vector3 {
    out.set(x, y, z).project(this.camera);
    return out.set(((out.x + 1) / 2) * this.canvas.clientWidth, ((1 - out.y) / 2) * this.canvas.clientHeight, out.z);
  }

  pixelsPerMm(): number { return this.canvas.clientWidth / (this.camera.right - this.camera.left); }

  // The contact at a place of the picture that is seen there; -1: none.
  pick(px: number, py: number): number {
    const geometry = this.points?.geometry;
    if (!geometry) return -1;
    const positions = geometry.getAttribute("position").array as Float32Array;
    const seen = geometry.getAttribute("seen").array as Uint8Array;
    let depth = Infinity;
    if (this.mesh) {
      const ray = new Raycaster();
      ray.setFromCamera({ x: (2 * px) / this.canvas.clientWidth - 1, y: 1 - (2 * py) / this.canvas.clientHeight } as never, this.camera);
      const hit = ray.intersectObject(this.mesh)[0];
      if (hit) depth = this.project(hit.point.x, hit.point.y, hit.point.z).z + this.dots.uniforms.bias.value * 1.5;
    }
    const matrix = this.camera.projectionMatrix.clone().multiply(this.camera.matrixWorldInverse).elements;
    let best = -1;
    let least = 12 ** 2;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    for (let i = 0; i < seen.length; ++i) {
      if (!seen[i]) continue;
      const x = positions[3 * i], y = positions[3 * i + 1], z = positions[3 * i + 2];
      const sx = ((matrix[0] * x + matrix[4] * y + matrix[8] * z + matrix[12] + 1) / 2) * width;
      const sy = ((1 - (matrix[1] * x + matrix[5] * y + matrix[9] * z + matrix[13])) / 2) * height;
      const apart = (sx - px) ** 2 + (sy - py) ** 2;
      if (!(apart < least)) continue;
      if (matrix[2] * x + matrix[6] * y + matrix[10] * z + matrix[14] > depth) continue;
      least = apart;
      best = i;
    }
    return best < 0 ? -1 : this.order[best];
  }
}
