/** The sea floor in space, with vehicles and their ways at their depth. three.js is fetched when it is first needed. */

import {
  AmbientLight,
  BufferAttribute,
  BufferGeometry,
  Color,
  ConeGeometry,
  DirectionalLight,
  DoubleSide,
  Group,
  Line,
  LineBasicMaterial,
  Mesh,
  MeshLambertMaterial,
  PerspectiveCamera,
  Points,
  PointsMaterial,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { LngLat, Place } from "../../api/types";
import { type Certainty, isMeasured } from "../picture/certainty";
import type { Range } from "../picture/layerColours";
import { colourAt, type Palette } from "../picture/palette";
import { cellOf, gridPlace, type SeaFloor, valueAt } from "../picture/seafloor";
import { Pace, shuffled } from "./levelOfDetail";

export interface SceneVehicle {
  name: string;
  colour: string;
  place: LngLat | null;
  depth_m: number | null;
  heading_deg: number | null;
  /** Where no depth is known it lies at the vehicle's. */
  way: readonly Place[];
}

/** Columns of equal length. */
export interface ScenePoints {
  lng: readonly number[];
  lat: readonly number[];
  depth_m: readonly number[];
}

const POINT_PX = 4;
/** So long after its last turn the view is still; a pointer that holds it may only have stopped. */
const STILL_MS = 300;
const HELD_STILL_MS = 1500;
/** What changes all the time is made anew at most so often, and not while the view is turned. */
const ANEW_MS = 1000;
/** While it is turned on a slow machine there are at least this many pixels for one on the screen. */
const COARSEST = 0.5;

function isDrawn(map: SeaFloor, row: number, col: number, { none_m }: Certainty): boolean {
  return (
    isMeasured(valueAt(map, "flags", row, col) ?? 0) || (valueAt(map, "uncertainty", row, col) ?? 0) < none_m
  );
}

/** East is x, up is y, south is z; metres from the middle of the map. */
export class SeaFloorScene {
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(45, 1, 0.1, 1e6);
  readonly #controls: OrbitControls;
  readonly #world = new Group();
  readonly #fleet = new Group();
  #points: Points<BufferGeometry, PointsMaterial> | null = null;
  #mesh: Mesh<BufferGeometry, MeshLambertMaterial> | null = null;
  #map: SeaFloor | null = null;
  #placed = false;
  #floorShown = true;
  #frame = 0;
  readonly #pace = new Pace();
  #turning = false;
  #held = false;
  #stillness: ReturnType<typeof setTimeout> | undefined;
  /** Newer than what is shown. */
  #newFloor: (() => void) | null = null;
  #newFleet: (() => void) | null = null;
  #madeAt_ms = -ANEW_MS;
  #making: ReturnType<typeof setTimeout> | undefined;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.#renderer = new WebGLRenderer({ canvas, antialias: true });
    this.#world.add(this.#fleet);
    this.#scene.add(this.#world, new AmbientLight(0xffffff, 1.5));
    const sun = new DirectionalLight(0xffffff, 2.2);
    sun.position.set(-1, 1.6, -0.8);
    this.#scene.add(sun);
    this.#controls = new OrbitControls(this.#camera, canvas);
    this.#controls.maxPolarAngle = Math.PI * 0.49;
    this.#controls.addEventListener("start", this.#hold);
    this.#controls.addEventListener("end", this.#release);
    this.#controls.addEventListener("change", this.#turned);
    this.#controls.listenToKeyEvents(canvas);
  }

  close(): void {
    cancelAnimationFrame(this.#frame);
    clearTimeout(this.#stillness);
    clearTimeout(this.#making);
    this.#controls.dispose();
    this.#forget(this.#mesh);
    this.#clearFleet();
    this.#forgetPoints();
    this.#renderer.dispose();
  }

  resize(width: number, height: number): void {
    this.#renderer.setSize(width, height, false);
    this.#camera.aspect = width / Math.max(1, height);
    this.#camera.updateProjectionMatrix();
    this.#draw();
  }

  setBackground(colour: string): void {
    this.#scene.background = new Color(colour);
    this.#draw();
  }

  /** How much higher than wide everything is drawn. */
  setExaggeration(times: number): void {
    this.#world.scale.y = times;
    this.#draw();
  }

  /** Where the map knows too little to be drawn from above there is nothing here either. */
  setSeaFloor(map: SeaFloor, palette: Palette, range: Range, certainty: Certainty): void {
    this.#map = map;
    this.#newFloor = () => this.#makeFloor(map, palette, range, certainty);
    if (!this.#placed) this.lookFromSouth();
    this.#makeAnew();
  }

  /** Makes what is newer than what is shown, at once or when there is time for it. */
  #makeAnew = (): void => {
    clearTimeout(this.#making);
    if (this.#turning) return;
    const wait_ms = this.#madeAt_ms + ANEW_MS - performance.now();
    if (wait_ms > 0) {
      this.#making = setTimeout(this.#makeAnew, wait_ms);
      return;
    }
    const floor = this.#floorShown ? this.#newFloor : null;
    if (!floor && !this.#newFleet) return;
    if (floor) this.#newFloor = null;
    floor?.();
    this.#newFleet?.();
    this.#newFleet = null;
    this.#madeAt_ms = performance.now();
    this.#draw();
  };

  #makeFloor(map: SeaFloor, palette: Palette, { low, high }: Range, certainty: Certainty): void {
    const { rows, cols, cell_m } = map;
    const places = new Float32Array(rows * cols * 3);
    const colours = new Float32Array(rows * cols * 3);
    const known = new Uint8Array(rows * cols);
    const shade = new Color();
    for (let row = 0; row < rows; row++) {
      for (let col = 0; col < cols; col++) {
        const at = row * cols + col;
        const depth = valueAt(map, "depth", row, col);
        known[at] = depth !== null && isDrawn(map, row, col, certainty) ? 1 : 0;
        places.set([(col + 0.5 - cols / 2) * cell_m, -(depth ?? 0), (rows / 2 - row - 0.5) * cell_m], at * 3);
        const [r, g, b] = colourAt(palette, depth ?? 0, low, high);
        shade.setRGB(r / 255, g / 255, b / 255, "srgb");
        colours.set([shade.r, shade.g, shade.b], at * 3);
      }
    }
    const corners: number[] = [];
    for (let row = 0; row + 1 < rows; row++) {
      for (let col = 0; col + 1 < cols; col++) {
        const [a, b, c, d] = [
          row * cols + col,
          row * cols + col + 1,
          (row + 1) * cols + col,
          (row + 1) * cols + col + 1,
        ];
        if (known[a] && known[b] && known[c] && known[d]) corners.push(a, b, c, b, d, c);
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(places, 3));
    geometry.setAttribute("color", new BufferAttribute(colours, 3));
    geometry.setIndex(corners);
    geometry.computeVertexNormals();
    this.#forget(this.#mesh);
    this.#mesh = new Mesh(geometry, new MeshLambertMaterial({ vertexColors: true, side: DoubleSide }));
    this.#mesh.visible = this.#floorShown;
    this.#world.add(this.#mesh);
  }

  /** The view it begins with: from the south, half from above. */
  lookFromSouth(): void {
    const map = this.#map;
    if (!map) return;
    this.#placed = true;
    const size = Math.max(map.rows, map.cols) * map.cell_m;
    const middle = (-((map.min_depth_m ?? 0) + (map.max_depth_m ?? 0)) / 2) * this.#world.scale.y;
    this.#controls.target.set(0, middle, 0);
    this.#camera.position.set(0, middle + size * 0.75, size * 1.05);
    this.#camera.near = size / 500;
    this.#camera.far = size * 20;
    this.#camera.updateProjectionMatrix();
    this.#controls.update();
    this.#draw();
  }

  setVehicles(vehicles: readonly SceneVehicle[]): void {
    this.#newFleet = () => this.#makeFleet(vehicles);
    this.#makeAnew();
  }

  #makeFleet(vehicles: readonly SceneVehicle[]): void {
    const map = this.#map;
    this.#clearFleet();
    if (!map) return;
    const size = Math.max(map.rows, map.cols) * map.cell_m;
    for (const vehicle of vehicles) {
      const material = new LineBasicMaterial({ color: vehicle.colour });
      const points = vehicle.way.flatMap((place) => {
        const at = this.#at(map, place, place[2] ?? vehicle.depth_m ?? 0);
        return at ? [at] : [];
      });
      if (points.length > 1) this.#fleet.add(new Line(new BufferGeometry().setFromPoints(points), material));
      const at = vehicle.place && this.#at(map, vehicle.place, vehicle.depth_m ?? 0);
      if (!at) continue;
      const cone = new Mesh(
        new ConeGeometry(size / 90, size / 30, 16).rotateX(-Math.PI / 2),
        new MeshLambertMaterial({ color: vehicle.colour }),
      );
      cone.position.copy(at);
      cone.scale.y = 1 / this.#world.scale.y;
      cone.rotation.y = (-(vehicle.heading_deg ?? 0) * Math.PI) / 180;
      this.#fleet.add(cone);
      // A thread up to the surface shows where it is.
      const up = new BufferGeometry().setFromPoints([at, new Vector3(at.x, 0, at.z)]);
      this.#fleet.add(
        new Line(up, new LineBasicMaterial({ color: vehicle.colour, transparent: true, opacity: 0.5 })),
      );
    }
  }

  /** Soundings as points, each with its colour (red, green, blue; 0 to 1); null: none. */
  setSoundings(points: ScenePoints | null): void {
    this.#forgetPoints();
    const map = this.#map;
    if (map && points) {
      const places = new Float32Array(3 * points.lng.length);
      points.lng.forEach((lng, i) => {
        const { col, row } = gridPlace(map, [lng, points.lat[i] as number]);
        const depth_m = points.depth_m[i] as number;
        places.set([(col - map.cols / 2) * map.cell_m, -depth_m, (map.rows / 2 - row) * map.cell_m], 3 * i);
      });
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(places, 3));
      geometry.setAttribute("color", new BufferAttribute(new Float32Array(3 * points.lng.length), 3));
      // Whatever share of them is drawn lies all over.
      geometry.setIndex(new BufferAttribute(shuffled(points.lng.length), 1));
      this.#points = new Points(
        geometry,
        new PointsMaterial({ size: POINT_PX, sizeAttenuation: false, vertexColors: true }),
      );
      this.#world.add(this.#points);
    }
    this.#draw();
  }

  /** Colours the points anew; `colours` has red, green and blue of each, 0 to 1. */
  colourSoundings(colours: Float32Array): void {
    const attribute = this.#points?.geometry.getAttribute("color");
    if (!attribute || attribute.array.length !== colours.length) return;
    attribute.array.set(colours);
    attribute.needsUpdate = true;
    this.#draw();
  }

  /** Where the points are on the canvas, x and y of each; not a number behind the camera. */
  soundingsOnScreen(): Float32Array {
    const places = this.#points?.geometry.getAttribute("position").array ?? [];
    const screen = new Float32Array((places.length / 3) * 2).fill(Number.NaN);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.#scene.updateMatrixWorld();
    this.#camera.updateMatrixWorld();
    const at = new Vector3();
    for (let i = 0; 3 * i < places.length; i++) {
      at.fromArray(places, 3 * i)
        .applyMatrix4(this.#world.matrixWorld)
        .project(this.#camera);
      if (at.z < -1 || at.z > 1) continue;
      screen[2 * i] = ((at.x + 1) / 2) * width;
      screen[2 * i + 1] = ((1 - at.y) / 2) * height;
    }
    return screen;
  }

  /** Whether the sea floor hides nothing of the points: it is left out. */
  setFloorShown(shown: boolean): void {
    this.#floorShown = shown;
    if (this.#mesh) this.#mesh.visible = shown;
    this.#makeAnew();
    this.#draw();
  }

  #forgetPoints(): void {
    if (!this.#points) return;
    this.#world.remove(this.#points);
    this.#points.geometry.dispose();
    this.#points.material.dispose();
    this.#points = null;
  }

  #at(map: SeaFloor, place: Place, depth_m: number): Vector3 | null {
    const cell = cellOf(map, place);
    return cell
      ? new Vector3((cell.col - map.cols / 2) * map.cell_m, -depth_m, (map.rows / 2 - cell.row) * map.cell_m)
      : null;
  }

  #clearFleet(): void {
    for (const child of [...this.#fleet.children]) {
      this.#fleet.remove(child);
      if (child instanceof Mesh || child instanceof Line) {
        child.geometry.dispose();
        child.material.dispose();
      }
    }
  }

  #forget(mesh: Mesh<BufferGeometry, MeshLambertMaterial> | null): void {
    if (!mesh) return;
    this.#world.remove(mesh);
    mesh.geometry.dispose();
    mesh.material.dispose();
  }

  #hold = (): void => {
    this.#held = true;
  };

  #release = (): void => {
    this.#held = false;
    if (this.#turning) this.#awaitStillness();
  };

  /** Turned, or moved, or looked at from nearer. */
  #turned = (): void => {
    if (!this.#turning) this.#pace.begin();
    this.#turning = true;
    this.#draw();
  };

  /** Counted from the last picture: on a slow machine the next turn is only seen after it. */
  #awaitStillness(): void {
    clearTimeout(this.#stillness);
    this.#stillness = setTimeout(this.#still, this.#held ? HELD_STILL_MS : STILL_MS);
  }

  #still = (): void => {
    this.#turning = false;
    this.#makeAnew();
    this.#draw();
  };

  /** Drawn only when something changed. */
  #draw = (): void => {
    cancelAnimationFrame(this.#frame);
    this.#frame = requestAnimationFrame(this.#render);
  };

  #render = (at_ms: number): void => {
    const detail = this.#turning ? this.#pace.detail : 1;
    const ratio = Math.min(devicePixelRatio, 2) * Math.max(COARSEST, Math.sqrt(detail));
    if (ratio !== this.#renderer.getPixelRatio()) this.#renderer.setPixelRatio(ratio);
    if (this.#points) {
      const { geometry } = this.#points;
      const all = geometry.getAttribute("position").count;
      geometry.setDrawRange(0, Math.ceil(detail * all));
      this.canvas.dataset.points = String(geometry.drawRange.count);
    }
    this.#renderer.render(this.#scene, this.#camera);
    if (this.#turning) requestAnimationFrame((next_ms) => this.#shown(next_ms - at_ms));
  };

  #shown(took_ms: number): void {
    this.#pace.drawn(took_ms);
    if (this.#turning) this.#awaitStillness();
  }
}
