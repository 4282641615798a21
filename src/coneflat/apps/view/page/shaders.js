// Shaders. Each pair draws an image or, with PICK defined, the numbers of things.

const VIEW_UNIFORMS = `
uniform mat3 turn;
uniform vec2 pan;
uniform vec2 zoom;  // clip units per unit
uniform vec2 size;  // Size of the pane in pixels.
vec4 clip(vec3 p) {
  vec3 q = turn * p;
  return vec4((q.xy - pan) * zoom, -0.45 * q.z, 1.0);
}
vec2 quadCorner() {  // -1 or 1 for the corners of the two triangles of a line or dot.
  int k = gl_VertexID % 6;
  return vec2(k == 1 || k == 2 || k == 4 ? 1.0 : -1.0, k == 2 || k == 4 || k == 5 ? 1.0 : -1.0);
}
float nearer(float pixels) {  // Change of clip depth for a distance in pixels towards the eye.
  return 0.9 * pixels / (zoom.y * size.y);
}
`;

const PICK_OUTPUT = `
flat in uint id;
out vec4 colour;
void write() {
  colour = vec4(uvec4(id, id >> 8u, id >> 16u, id >> 24u) & 255u) / 255.0;
}
`;

const SURFACE_VERTEX = `
layout(location = 0) in vec3 place;
layout(location = 1) in vec2 uv;
layout(location = 2) in vec4 normal;
layout(location = 3) in float value;
layout(location = 4) in vec4 marks;
layout(location = 5) in vec2 own;  // UVs of the file.
uniform bool inPlane, asInFile;
uniform bool layered;  // In the layout, triangles with a fault are over those without: the smaller their tone, the higher.
uniform vec3 plane;  // The centre of the layout, and its unit.
${VIEW_UNIFORMS}
#ifdef PICK
flat out uint id;
#else
out vec3 facing;
out vec3 corner;
out vec3 mark;
out vec2 at;
out float tone;
#endif
void main() {
  float height = layered && value > 0.25 ? 1e-5 * (1.0 - value) : 0.0;
  gl_Position = clip(inPlane ? vec3((uv - plane.xy) * plane.z, height) : place);
#ifdef PICK
  id = uint(gl_VertexID / 3) + 1u;
#else
  int k = gl_VertexID % 3;
  corner = vec3(k == 0, k == 1, k == 2);
  facing = turn * normal.xyz;
  at = asInFile ? own : uv;
  tone = value;
  mark = marks.rgb;
#endif
}
`;

const SURFACE_FRAGMENT = `
#ifdef PICK
${PICK_OUTPUT}
void main() { write(); }
#else
in vec3 facing;
in vec3 corner;
in vec3 mark;
in vec2 at;
in float tone;
out vec4 colour;
uniform bool inPlane;
uniform bool board, pictured, tinted;
uniform sampler2D table, picture;
uniform vec3 paint, dark, undefinedPaint;
uniform float cell, edges, outward, contrast, marked;
uniform float hatch;  // Pixels of the render target per CSS pixel.

const vec3 KEY_LIGHT = vec3(-0.4478, 0.6469, 0.6170);  // From the upper left, as in drawings.

float wave(float x) { return 1.0 - abs(mod(x, 2.0) - 1.0); }

// Fraction of light squares in the pixel: the mean of the board over its footprint, so that small squares become grey.
float lightShare() {
  vec2 width = max(fwidth(at), vec2(3e-4 * cell));
  vec2 low = (at - 0.5 * width) / cell, high = (at + 0.5 * width) / cell;
  vec2 mean = vec2(wave(high.x) - wave(low.x), wave(high.y) - wave(low.y)) * cell / width;
  return 0.5 + 0.5 * mean.x * mean.y;
}

float edgeShare() {
  vec3 width = fwidth(corner);
  vec3 off = smoothstep(vec3(0.0), 1.3 * width, corner);
  float crowded = smoothstep(0.15, 0.5, max(width.x, max(width.y, width.z)));
  return edges * (1.0 - crowded) * (1.0 - min(off.x, min(off.y, off.z)));
}

// Layers of paint differ in colour and, for colour-blind users, in pattern: rising lines, falling lines, dots that grow
// with the strength. Each has a dark tone on a light one with a contrast of 3:1, so that it is seen on every ground.
vec3 withMarks(vec3 base) {
  vec3 width = max(fwidth(mark), vec3(1e-4));
  vec3 on = smoothstep(0.5 - width, 0.5 + width, mark) * marked;
  vec2 p = gl_FragCoord.xy / hatch;
  vec2 line = abs(fract(vec2(p.x - p.y, p.x + p.y) / 11.0) - 0.5) * 11.0;
  vec2 lines = 1.0 - smoothstep(1.5, 2.2, line);
  float radius = mix(1.8, 3.2, clamp(2.0 * mark.b - 1.0, 0.0, 1.0));
  float dots = 1.0 - smoothstep(radius - 0.5, radius + 0.5, length(fract(p / 9.0) - 0.5) * 9.0);
  base = mix(base, vec3(0.97, 0.86, 0.94), 0.85 * on.b);
  base = mix(base, vec3(1.0, 0.91, 0.78), 0.85 * on.r);
  base = mix(base, vec3(0.88, 0.94, 0.98), 0.85 * on.g);
  base = mix(base, vec3(0.50, 0.16, 0.42), 0.95 * on.b * dots);
  base = mix(base, vec3(0.58, 0.30, 0.0), 0.95 * on.r * lines.x);
  return mix(base, vec3(0.0, 0.40, 0.72), 0.95 * on.g * lines.y);
}

void main() {
  vec3 base = paint;
  if (tinted) base = tone < 0.0 ? undefinedPaint : texture(table, vec2(tone, 0.5)).rgb;
  if (pictured && at.x > -1e5) {
    vec4 texel = texture(picture, vec2(at.x, 1.0 - at.y));
    base = mix(base, texel.rgb, texel.a);
  }
  if (board) base *= mix(dark, vec3(1.0), lightShare());
  if (marked > 0.0) base = withMarks(base);
  if (edges > 0.0) base *= 1.0 - 0.65 * edgeShare();
  if (!inPlane) {
    vec3 n = normalize(gl_FrontFacing ? facing : -facing);
    float key = max(dot(n, KEY_LIGHT), 0.0);
    float light = 0.52 + 0.40 * key + 0.14 * max(n.z, 0.0) + 0.08 * n.y;
    if (gl_FrontFacing != (outward > 0.0)) light *= 0.62;
    base *= 1.0 + contrast * (light - 1.0);
  }
  colour = vec4(base, 1.0);
}
#endif
`;

const LINE_VERTEX = `
layout(location = 0) in vec3 begin;
layout(location = 1) in vec3 end;
uniform float radius, lift;
${VIEW_UNIFORMS}
#ifdef PICK
uniform uint first, sides;
flat out uint id;
#else
out vec2 off;
flat out float length_;
#endif
void main() {
  vec4 a = clip(begin), b = clip(end);
  vec2 way = (b.xy - a.xy) * 0.5 * size;
  float far = length(way);
  vec2 along = far > 1e-4 ? way / far : vec2(1.0, 0.0);
  vec2 across = vec2(-along.y, along.x);
  bool atEnd = quadCorner().x > 0.0;
  float side = quadCorner().y;
  vec4 here = atEnd ? b : a;
  vec2 step = (atEnd ? along : -along) * radius + across * side * radius;
  gl_Position = vec4(here.xy + step / (0.5 * size), here.z - nearer(lift), 1.0);
#ifdef PICK
  id = first + uint(gl_VertexID / 6) / sides;
#else
  off = vec2(atEnd ? far + radius : -radius, side * radius);
  length_ = far;
#endif
}
`;

const LINE_FRAGMENT = `
#ifdef PICK
${PICK_OUTPUT}
void main() { write(); }
#else
in vec2 off;
flat in float length_;
out vec4 colour;
uniform float radius, strength;
uniform vec3 ink;
uniform vec4 dashes;  // A dash, a gap, a dash and a gap, device pixels, from the middle of the first dash; 0 for solid lines.
void main() {
  float period = dashes.x + dashes.y + dashes.z + dashes.w;
  if (period > 0.0) {
    float at = mod(off.x - 0.5 * length_ + 0.5 * dashes.x, period) - dashes.x;
    if ((at > 0.0 && at < dashes.y) || at > dashes.y + dashes.z) discard;
  }
  float away = length(vec2(max(max(-off.x, off.x - length_), 0.0), off.y));
  float inside = 1.0 - smoothstep(radius - 1.5, radius - 0.5, away);
  if (inside < 0.02) discard;
  colour = vec4(ink, inside * strength);
}
#endif
`;

const DOT_VERTEX = `
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 dot_;  // Radius in pixels, sign, number.
uniform float pixel;  // device pixels per pixel
${VIEW_UNIFORMS}
#ifdef PICK
uniform uint first;
flat out uint id;
#else
out vec2 off;
flat out float radius, positive;
#endif
void main() {
  float size_ = (dot_.x + 1.5) * pixel;
  vec2 corner = quadCorner() * size_;
  vec4 here = clip(place);
  gl_Position = vec4(here.xy + corner / (0.5 * size), here.z - nearer(size_ + 3.0), 1.0);
#ifdef PICK
  id = first + uint(dot_.z);
#else
  off = corner;
  radius = dot_.x * pixel;
  positive = dot_.y;
#endif
}
`;

const DOT_FRAGMENT = `
#ifdef PICK
${PICK_OUTPUT}
void main() { write(); }
#else
in vec2 off;
flat in float radius, positive;
out vec4 colour;
uniform float pixel;
void main() {
  // Discs for positive curvature, squares for negative curvature.
  float away = positive > 0.0 ? length(off) : 1.12 * max(abs(off.x), abs(off.y));
  float inside = 1.0 - smoothstep(radius - pixel - 0.5, radius - pixel + 0.5, away);
  float rim = 1.0 - smoothstep(radius, radius + pixel, away);
  if (rim < 0.02) discard;
  colour = vec4(mix(vec3(1.0), positive > 0.0 ? vec3(0.84, 0.13, 0.13) : vec3(0.0), inside), rim);
}
#endif
`;
