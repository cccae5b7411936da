// A camera about a target, Z upright, turned, moved and zoomed by three.js's OrbitControls: views, keys, and boxes shown whole.
const FIRST_VIEW = [-1.05, 0.22]; // azimuth and elevation, radians
const STEEPEST = 1.55; // elevation, radians
class Orbit {
  constructor(canvas, changed) {
    this.camera = new THREE.PerspectiveCamera(26, 1, 1, 5000);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { minDistance: 2, maxDistance: 3000, minPolarAngle: Math.PI / 2 - STEEPEST, maxPolarAngle: Math.PI / 2 + STEEPEST });
    this.place(...FIRST_VIEW, 100);
    this.controls.addEventListener("change", changed);
  }

  get target() { return this.controls.target; }
  get offset() { return new THREE.Vector3().subVectors(this.camera.position, this.target); }
  get distance() { return this.controls.getDistance(); }
  get azimuth() { return Math.atan2(this.offset.y, this.offset.x); }
  get elevation() { return Math.asin(this.offset.z / this.distance); }
  get rightOfView() { return new THREE.Vector3(-Math.sin(this.azimuth), Math.cos(this.azimuth), 0); }

  place(azimuth, elevation, distance) {
    const steep = Math.max(-STEEPEST, Math.min(STEEPEST, elevation)), flat = Math.cos(steep) * distance;
    this.camera.position.set(flat * Math.cos(azimuth), flat * Math.sin(azimuth), distance * Math.sin(steep)).add(this.target);
    this.controls.update();
  }

  turn(azimuth, elevation) { this.place(this.azimuth + azimuth, this.elevation + elevation, this.distance); }
  zoom(factor) { this.place(this.azimuth, this.elevation, this.distance * factor); }
  look(azimuth, elevation) { this.place(azimuth, elevation, this.distance); }

  // Show a box (low, high) whole, whatever the direction.
  fit(low, high, lift = 0) {
    const { azimuth, elevation } = this;
    const size = new THREE.Vector3().subVectors(high, low);
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const flat = Math.hypot(size.x, size.y);
    const aspect = Math.max(this.camera.aspect, 0.2);
    const distance = 0.5 * flat + 0.56 * Math.max(size.z / half, flat / half / aspect);
    this.target.addVectors(low, high).multiplyScalar(0.5);
    this.target.z -= lift * distance * half;
    this.place(azimuth, elevation, distance);
  }

  update() {
    this.camera.near = Math.max(0.1, this.distance / 200);
    this.camera.far = this.distance + 2000;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }
}
