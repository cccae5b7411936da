// What the page uses of three.js: `npm install && npm run build` in this folder makes three.min.js of it.
export {
  BoxGeometry, BufferAttribute, BufferGeometry, Color, ColorManagement, CylinderGeometry, DirectionalLight, DoubleSide, Group,
  HemisphereLight, Line, LineBasicMaterial, LineSegments, LinearSRGBColorSpace, Matrix4, Mesh, MeshBasicMaterial, MeshPhongMaterial,
  PerspectiveCamera, Plane, Points, PointsMaterial, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
