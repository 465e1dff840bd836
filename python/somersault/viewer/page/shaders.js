// Programs of the graphics processor.

const PRECISION = `#version 300 es
precision highp float;
precision highp sampler2DShadow;
`;

const SOLID_VERTICES = `${PRECISION}
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 model, view;
out vec3 place, local, outward;
void main() {
  vec4 world = model * vec4(position, 1.0);
  place = world.xyz;
  local = position;
  outward = mat3(model) * normal;
  gl_Position = view * world;
}`;

const COLOURS = `
const vec3 HORIZON = vec3(0.925, 0.945, 0.965), ZENITH = vec3(0.62, 0.76, 0.90);`;

// Sunlight with a soft shadow, and light from sky and ground.
const LIGHTING = `${COLOURS}
uniform mat4 light;
uniform vec3 sun, eye;
uniform float shadowed;
uniform sampler2DShadow shadows;

float lit(vec3 place, vec3 outward) {
  vec4 seen = light * vec4(place + outward * shadowed, 1.0);
  vec3 at = seen.xyz * 0.5 + 0.5;
  if (any(lessThan(at, vec3(0.0))) || any(greaterThan(at, vec3(1.0)))) return 1.0;
  float sum = 0.0, texel = 2.2 / float(textureSize(shadows, 0).x);
  for (int i = -2; i <= 2; i++)
    for (int j = -2; j <= 2; j++)
      sum += texture(shadows, vec3(at.xy + vec2(i, j) * texel, at.z - 0.0008));
  return sum / 25.0;
}

vec3 shaded(vec3 colour, vec3 place, vec3 outward, float gloss) {
  float facing = dot(outward, sun);
  float sunlight = max(facing, 0.0) * lit(place, outward);
  vec3 ambient = mix(vec3(0.48, 0.46, 0.45), vec3(0.52, 0.54, 0.58), outward.z * 0.5 + 0.5);
  vec3 toward = normalize(eye - place);
  float rim = pow(1.0 - max(dot(outward, toward), 0.0), 3.0) * 0.12;
  float shine = pow(max(dot(outward, normalize(sun + toward)), 0.0), 36.0) * gloss * step(0.001, sunlight);
  return colour * (ambient + vec3(0.60, 0.57, 0.53) * sunlight) + rim + shine;
}
`;

const SOLID_FRAGMENTS = `${PRECISION}
${LIGHTING}
in vec3 place, local, outward;
uniform vec3 colour;
uniform float checkered, opacity;
out vec4 fragment;
void main() {
  vec3 facing = normalize(gl_FrontFacing ? outward : -outward);
  float octant = local.x * local.y * local.z;
  vec3 paint = mix(colour, octant > 0.0 ? colour : mix(colour, vec3(1.0), 0.55), checkered);
  fragment = vec4(shaded(paint, place, facing, 0.22), opacity);
}`;

const DEPTH_FRAGMENTS = `${PRECISION}
void main() {}`;

const PLANE_VERTICES = `${PRECISION}
layout(location = 0) in vec2 corner;
uniform mat4 view;
uniform vec3 middle;
uniform float reach;
out vec3 place;
void main() {
  place = vec3(middle.xy + corner * reach, middle.z);
  gl_Position = view * vec4(place, 1.0);
}`;

const GROUND_FRAGMENTS = `${PRECISION}
${LIGHTING}
in vec3 place;
uniform vec3 middle;
uniform float reach, spacing;
out vec4 fragment;
float lines(float every, float width) {
  vec2 at = place.xy / every, blur = fwidth(at);
  vec2 from = abs(fract(at - 0.5) - 0.5);
  vec2 drawn = 1.0 - smoothstep(blur * width, blur * (width + 1.0), from);
  return max(drawn.x, drawn.y) * (1.0 - smoothstep(0.15, 0.6, max(blur.x, blur.y)));
}
void main() {
  vec3 colour = vec3(0.88, 0.885, 0.875);
  colour *= 1.0 - 0.07 * lines(spacing, 0.3) - 0.07 * lines(spacing * 2.0, 0.5);
  colour *= 0.60 + 0.40 * lit(place, vec3(0.0, 0.0, 1.0));
  float away = length(place.xy - middle.xy) / reach;
  fragment = vec4(mix(colour, HORIZON, smoothstep(0.15, 0.95, away)), 1.0);
}`;

const WATER_FRAGMENTS = `${PRECISION}
${LIGHTING}
in vec3 place;
uniform vec3 middle;
uniform float reach, spacing, time;
out vec4 fragment;
void main() {
  vec2 at = place.xy / spacing * 2.4;
  vec2 slope = vec2(
    cos(at.x * 1.7 + at.y * 0.6 + time) + 0.7 * cos(at.x * 3.1 - at.y * 1.9 - 1.3 * time),
    cos(at.y * 1.9 - at.x * 0.5 - 0.8 * time) + 0.7 * cos(at.y * 3.3 + at.x * 2.3 + 1.1 * time));
  float away = length(place.xy - middle.xy) / reach;
  vec3 outward = normalize(vec3(0.05 * slope * (1.0 - smoothstep(0.0, 0.5, away)), 1.0));
  vec3 toward = normalize(eye - place);
  if (dot(toward, outward) < 0.0) outward = -outward;
  float grazing = pow(1.0 - abs(dot(outward, toward)), 4.0);
  vec3 colour = mix(vec3(0.10, 0.44, 0.60), vec3(0.16, 0.55, 0.68), 0.5 + 0.5 * outward.x * 12.0);
  colour *= 0.72 + 0.28 * lit(place, vec3(0.0, 0.0, 1.0));
  colour = mix(colour, mix(HORIZON, ZENITH, 0.5), 0.75 * grazing);
  colour += pow(max(dot(outward, normalize(sun + toward)), 0.0), 220.0) * 0.5;
  float far = smoothstep(0.15, 0.95, away);
  fragment = vec4(mix(colour, HORIZON, far), mix(0.72 + 0.25 * grazing, 1.0, far));
}`;

const SKY_VERTICES = `${PRECISION}
layout(location = 0) in vec2 corner;
uniform vec3 forward, across, above;
out vec3 way;
void main() {
  way = forward + across * corner.x + above * corner.y;
  gl_Position = vec4(corner, 0.99999, 1.0);
}`;

const SKY_FRAGMENTS = `${PRECISION}
${COLOURS}
in vec3 way;
out vec4 fragment;
void main() {
  float height = normalize(way).z;
  vec3 colour = mix(HORIZON, ZENITH, smoothstep(0.0, 0.55, height));
  fragment = vec4(mix(colour, vec3(0.80, 0.82, 0.84), smoothstep(0.25, 1.0, -height)), 1.0);
}`;

// A stretch of a trail: a strip of constant width in pixels.
const LINE_VERTICES = `${PRECISION}
layout(location = 0) in vec2 corner;
layout(location = 1) in vec3 start;
layout(location = 2) in vec3 end;
uniform mat4 view;
uniform vec2 pixels;
uniform float width;
void main() {
  vec4 from = view * vec4(start, 1.0), to = view * vec4(end, 1.0);
  vec2 way = (to.xy / to.w - from.xy / from.w) * pixels;
  way = length(way) > 1e-6 ? normalize(way) : vec2(1.0, 0.0);
  vec2 aside = vec2(-way.y, way.x) * corner.y + way * (corner.x > 0.5 ? 0.4 : -0.4);
  vec4 here = corner.x > 0.5 ? to : from;
  gl_Position = here + vec4(aside * width / pixels * here.w, -1e-4 * here.w, 0.0);
}`;

const LINE_FRAGMENTS = `${PRECISION}
uniform vec3 colour;
uniform float opacity;
out vec4 fragment;
void main() {
  fragment = vec4(colour, opacity);
}`;
