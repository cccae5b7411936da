// A camera about a target, Z upright: drag turns, wheel zooms, right drag moves.
class Orbit {
  constructor(canvas, changed) {
    this.camera = new THREE.PerspectiveCamera(26, 1, 1, 5000);
    this.camera.up.set(0, 0, 1);
    this.target = new THREE.Vector3();
    this.azimuth = -1.05;
    this.elevation = 0.22;
    this.distance = 100;
    this.changed = changed;
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, event);
    });
    canvas.addEventListener("pointerup", (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("pointercancel", (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => this.drag(event, canvas));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(Math.max(-0.5, Math.min(0.5, event.deltaY * 0.0012))));
    }, { passive: false });
  }

  drag(event, canvas) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
    if (this.pointers.size === 2) {
      const other = [...this.pointers.values()].find((pointer) => pointer !== before);
      const length = (a) => Math.hypot(a.clientX - other.clientX, a.clientY - other.clientY);
      this.zoom(length(before) / Math.max(length(event), 1));
    } else if (event.buttons & 2 || event.shiftKey) {
      this.move(dx, dy, canvas.clientHeight);
    } else {
      this.turn(-dx * 0.008, dy * 0.008);
    }
    this.pointers.set(event.pointerId, event);
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-1.55, Math.min(1.55, this.elevation + elevation));
    this.changed();
  }

  zoom(factor) {
    this.distance = Math.max(2, Math.min(3000, this.distance * factor));
    this.changed();
  }

  move(dx, dy, height) {
    const scale = 2 * this.distance * Math.tan((this.camera.fov * Math.PI) / 360) / height;
    const right = new THREE.Vector3(), up = new THREE.Vector3(), back = new THREE.Vector3();
    this.camera.matrixWorld.extractBasis(right, up, back);
    this.target.addScaledVector(right, -dx * scale).addScaledVector(up, dy * scale);
    this.changed();
  }

  look(azimuth, elevation) {
    this.azimuth = azimuth;
    this.elevation = elevation;
    this.changed();
  }

  // Show a box (low, high) whole, whatever the direction.
  fit(low, high, lift = 0) {
    const size = new THREE.Vector3().subVectors(high, low);
    this.target.addVectors(low, high).multiplyScalar(0.5);
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const flat = Math.hypot(size.x, size.y);
    const aspect = Math.max(this.camera.aspect, 0.2);
    this.distance = 0.5 * flat + 0.56 * Math.max(size.z / half, flat / half / aspect);
    this.target.z -= lift * this.distance * half;
    this.changed();
  }

  update() {
    const flat = Math.cos(this.elevation) * this.distance;
    this.camera.position.set(
      this.target.x + flat * Math.cos(this.azimuth),
      this.target.y + flat * Math.sin(this.azimuth),
      this.target.z + this.distance * Math.sin(this.elevation),
    );
    this.camera.near = Math.max(0.1, this.distance / 200);
    this.camera.far = this.distance + 2000;
    this.camera.updateProjectionMatrix();
    this.camera.lookAt(this.target);
    this.camera.updateMatrixWorld();
  }
}
