// The shading model of shading.h in GLSL, statement by statement as in cpu_kernels_template.h.
#pragma once

namespace touchstone::image {

inline constexpr char kVertexShader[] = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 clip_from_object;
out vec3 point;
out vec3 smooth_normal;
void main() {
  point = position;
  smooth_normal = normal;
  gl_Position = clip_from_object * vec4(position, 1.0);
}
)";

// Output 0: grey level in red, 1 in green as the mask. Output 1: depth in metres, which is clip space's w.
inline constexpr char kFragmentShader[] = R"(#version 330 core
in vec3 point;
in vec3 smooth_normal;
uniform vec4 light[2];  // position in the object frame, strength
uniform float ambient;
uniform float scale;
layout(location = 0) out vec4 grey_and_mask;
layout(location = 1) out float depth_m;
void main() {
  vec3 n = gl_FrontFacing ? smooth_normal : -smooth_normal;
  float nn = dot(n, n);
  float shade = ambient;
  vec3 l = light[0].xyz - point;
  shade += light[0].w * (max(dot(n, l), 0.0) * inversesqrt(nn * dot(l, l) + 1e-30));
  l = light[1].xyz - point;
  shade += light[1].w * (max(dot(n, l), 0.0) * inversesqrt(nn * dot(l, l) + 1e-30));
  float level = floor(min(shade, 1.0) * scale * 255.0 + 0.5);
  grey_and_mask = vec4(level / 255.0, 1.0, 0.0, 1.0);
  depth_m = 1.0 / gl_FragCoord.w;
}
)";

}  // namespace touchstone::image
