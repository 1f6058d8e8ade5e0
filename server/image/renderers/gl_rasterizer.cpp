#include "server/image/renderers/gl_rasterizer.h"

#include <cstddef>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <epoxy/gl.h>

#include "server/base/status.h"
#include "server/image/renderers/egl_shader.h"
#include "server/image/scene/shading.h"
#include "server/image/scene/view.h"

namespace touchstone::image {
namespace {

absl::StatusOr<GLuint> CompileShader(GLenum kind, const char* source) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint compiled = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled) return shader;
  char log[2048] = "";
  glGetShaderInfoLog(shader, sizeof log, nullptr, log);
  glDeleteShader(shader);
  return absl::UnavailableError(absl::StrCat("the OpenGL driver does not compile our shader: ", log));
}

absl::Status TakeGlError(const char* action) {
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return absl::OkStatus();
  if (error == GL_OUT_OF_MEMORY)
    return absl::ResourceExhaustedError(absl::StrCat("OpenGL has no memory left while ", action));
  return absl::InternalError(absl::StrFormat("OpenGL error 0x%04x while %s", error, action));
}

// Clip space of OpenGL, y down; composed in double precision, so that a far-away eye costs no digits.
void ClipFromObject(const View& view, float column_major[16]) {
  const double span_m = view.far_m - view.near_m;
  const Eigen::Vector3d x = view.right * (2.0 / (view.width * view.step));
  const Eigen::Vector3d y = view.up * (-2.0 / (view.height * view.step));
  const Eigen::Vector3d z = view.forward * ((view.far_m + view.near_m) / span_m);
  const Eigen::Vector3d rows[4] = {x, y, z, view.forward};
  for (int row = 0; row < 4; ++row) {
    for (int axis = 0; axis < 3; ++axis) column_major[4 * axis + row] = static_cast<float>(rows[row][axis]);
    double constant = -rows[row].dot(view.eye_m);
    if (row == 2) constant -= 2.0 * view.far_m * view.near_m / span_m;
    column_major[12 + row] = static_cast<float>(constant);
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<GlRasterizer>> GlRasterizer::Create() {
  std::unique_ptr<GlRasterizer> rasterizer(new GlRasterizer);
  const GLubyte* name = glGetString(GL_RENDERER);
  rasterizer->gl_renderer_ = name == nullptr ? "unnamed OpenGL" : reinterpret_cast<const char*>(name);
  TOUCHSTONE_RETURN_IF_ERROR(rasterizer->CompileProgram());
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glDisable(GL_DITHER);
  glFrontFace(GL_CW);  // counter-clockwise, seen in an image whose y points down
  glCullFace(GL_BACK);
  TOUCHSTONE_RETURN_IF_ERROR(TakeGlError("setting up"));
  return rasterizer;
}

GlRasterizer::~GlRasterizer() {
  for (const Buffers& buffers : meshes_) Delete(buffers);
  DeleteTarget();
  if (program_ != 0) glDeleteProgram(program_);
}

absl::Status GlRasterizer::CompileProgram() {
  TOUCHSTONE_ASSIGN_OR_RETURN(const GLuint vertex, CompileShader(GL_VERTEX_SHADER, kVertexShader));
  const absl::StatusOr<GLuint> fragment = CompileShader(GL_FRAGMENT_SHADER, kFragmentShader);
  if (!fragment.ok()) {
    glDeleteShader(vertex);
    return fragment.status();
  }
  program_ = glCreateProgram();
  glAttachShader(program_, vertex);
  glAttachShader(program_, *fragment);
  glLinkProgram(program_);
  glDeleteShader(vertex);
  glDeleteShader(*fragment);
  GLint linked = 0;
  glGetProgramiv(program_, GL_LINK_STATUS, &linked);
  if (!linked) {
    char log[2048] = "";
    glGetProgramInfoLog(program_, sizeof log, nullptr, log);
    return absl::UnavailableError(absl::StrCat("the OpenGL driver does not link our shaders: ", log));
  }
  glUseProgram(program_);
  clip_from_object_ = glGetUniformLocation(program_, "clip_from_object");
  light_ = glGetUniformLocation(program_, "light");
  ambient_ = glGetUniformLocation(program_, "ambient");
  scale_ = glGetUniformLocation(program_, "scale");
  return absl::OkStatus();
}

void GlRasterizer::DeleteTarget() {
  if (frame_buffer_ != 0) glDeleteFramebuffers(1, &frame_buffer_);
  for (uint32_t* buffer : {&grey_buffer_, &metres_buffer_, &depth_buffer_}) {
    if (*buffer != 0) glDeleteRenderbuffers(1, buffer);
    *buffer = 0;
  }
  frame_buffer_ = 0;
  target_ = Target{};
}

absl::Status GlRasterizer::PrepareTarget(const Target& target) {
  if (frame_buffer_ != 0 && target == target_) return absl::OkStatus();
  DeleteTarget();
  glGenFramebuffers(1, &frame_buffer_);
  glBindFramebuffer(GL_FRAMEBUFFER, frame_buffer_);
  const auto attach = [&target](GLenum place, GLenum format, uint32_t* buffer) {
    glGenRenderbuffers(1, buffer);
    glBindRenderbuffer(GL_RENDERBUFFER, *buffer);
    glRenderbufferStorage(GL_RENDERBUFFER, format, target.width, target.height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, place, GL_RENDERBUFFER, *buffer);
  };
  attach(GL_COLOR_ATTACHMENT0, target.mask ? GL_RG8 : GL_R8, &grey_buffer_);
  if (target.depth) attach(GL_COLOR_ATTACHMENT1, GL_R32F, &metres_buffer_);
  attach(GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT24, &depth_buffer_);
  const GLenum outputs[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glDrawBuffers(target.depth ? 2 : 1, outputs);
  const GLenum complete = glCheckFramebufferStatus(GL_FRAMEBUFFER);
  absl::Status status = TakeGlError("making a frame buffer");
  if (status.ok() && complete != GL_FRAMEBUFFER_COMPLETE) {
    status = absl::UnavailableError(absl::StrFormat(
        "OpenGL refuses a frame buffer of %d x %d pixels (0x%04x)", target.width, target.height, complete));
  }
  if (!status.ok()) {
    DeleteTarget();
    return status;
  }
  glViewport(0, 0, target.width, target.height);
  target_ = target;
  return absl::OkStatus();
}

void GlRasterizer::Delete(const Buffers& buffers) {
  glDeleteVertexArrays(1, &buffers.vertex_array);
  glDeleteBuffers(1, &buffers.vertices);
  glDeleteBuffers(1, &buffers.corners);
}

absl::StatusOr<uint32_t> GlRasterizer::VertexArrayOf(const std::shared_ptr<const geometry::Surface>& surface,
                                                     const ShadingMesh& mesh) {
  // Buffers of destroyed surfaces are freed; the one asked for moves to the front.
  uint64_t bytes = 0;
  bool found = false;
  for (auto entry = meshes_.begin(); entry != meshes_.end();) {
    const auto next = std::next(entry);
    const std::shared_ptr<const geometry::Surface> owner = entry->surface.lock();
    if (owner == nullptr) {
      Delete(*entry);
      meshes_.erase(entry);
    } else {
      bytes += entry->bytes;
      if (owner == surface) {
        meshes_.splice(meshes_.begin(), meshes_, entry);
        found = true;
      }
    }
    entry = next;
  }
  if (found) return meshes_.front().vertex_array;

  Buffers buffers;
  buffers.surface = surface;
  buffers.bytes = mesh.MemoryBytes();
  while (!meshes_.empty() && (meshes_.size() >= kMaxMeshes || bytes + buffers.bytes > kMaxBytes)) {
    bytes -= meshes_.back().bytes;
    Delete(meshes_.back());
    meshes_.pop_back();
  }
  using Vertex = ShadingMesh::Vertex;
  glGenVertexArrays(1, &buffers.vertex_array);
  glBindVertexArray(buffers.vertex_array);
  glGenBuffers(1, &buffers.vertices);
  glBindBuffer(GL_ARRAY_BUFFER, buffers.vertices);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.vertices.size() * sizeof(Vertex)),
               mesh.vertices.data(), GL_STATIC_DRAW);
  glGenBuffers(1, &buffers.corners);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers.corners);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.corners.size() * sizeof(uint32_t)),
               mesh.corners.data(), GL_STATIC_DRAW);
  const auto offset = [](size_t bytes_in) { return reinterpret_cast<const void*>(bytes_in); };
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(offsetof(Vertex, position_m)));
  glEnableVertexAttribArray(1);
  glVertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(offsetof(Vertex, normal)));
  if (absl::Status status = TakeGlError("uploading a mesh"); !status.ok()) {
    Delete(buffers);
    return status;
  }
  meshes_.push_front(buffers);
  return buffers.vertex_array;
}

void GlRasterizer::ReadBack(const ImageOptions& options, Image* image) {
  const int width = options.width, height = options.height;
  const size_t pixels = static_cast<size_t>(width) * height;
  glReadBuffer(GL_COLOR_ATTACHMENT0);
  std::vector<uint8_t> grey(options.mask ? 2 * pixels : pixels);
  glReadPixels(0, 0, width, height, options.mask ? GL_RG : GL_RED, GL_UNSIGNED_BYTE, grey.data());
  if (options.mask) {
    image->mask.resize(pixels);
    for (size_t i = 0; i < pixels; ++i) {
      image->mask[i] = grey[2 * i + 1];
      grey[i] = grey[2 * i];
    }
    grey.resize(pixels);
  }
  if (options.depth) {
    image->depth_m.resize(pixels);
    glReadBuffer(GL_COLOR_ATTACHMENT1);
    glReadPixels(0, 0, width, height, GL_RED, GL_FLOAT, image->depth_m.data());
  }
  // White light on a white surface: the three colours are equal, so only one is drawn and carried.
  if (options.format == PixelFormat::kGrey) {
    image->channels = 1;
    image->pixels = std::move(grey);
  } else {
    image->channels = 3;
    image->pixels.resize(3 * pixels);
    for (size_t i = 0; i < pixels; ++i)
      image->pixels[3 * i] = image->pixels[3 * i + 1] = image->pixels[3 * i + 2] = grey[i];
  }
}

absl::StatusOr<Image> GlRasterizer::Draw(const std::shared_ptr<const geometry::Surface>& surface,
                                         const ShadingMesh& mesh, const Camera& camera,
                                         const ImageOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(PrepareTarget({options.width, options.height, options.depth, options.mask}));
  TOUCHSTONE_ASSIGN_OR_RETURN(const GLuint vertex_array, VertexArrayOf(surface, mesh));
  const View view = MakeView(camera, surface->bounds(), options);
  const Lighting lighting = MakeLighting(view, surface->bounds(), options.shading_style);

  const float background[4] = {lighting.background / 255.0f, 0, 0, 0};
  const float nothing[4] = {0, 0, 0, 0};
  const float farthest = 1;
  glClearBufferfv(GL_COLOR, 0, background);
  if (options.depth) glClearBufferfv(GL_COLOR, 1, nothing);
  glClearBufferfv(GL_DEPTH, 0, &farthest);

  float clip_from_object[16];
  ClipFromObject(view, clip_from_object);
  float lights[kLights.size()][4];
  for (size_t i = 0; i < kLights.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) lights[i][axis] = lighting.position_m[i][axis];
    lights[i][3] = kLights[i].strength;
  }
  glUniformMatrix4fv(clip_from_object_, 1, GL_FALSE, clip_from_object);
  glUniform4fv(light_, static_cast<GLsizei>(kLights.size()), &lights[0][0]);
  glUniform1f(ambient_, kAmbient);
  glUniform1f(scale_, lighting.scale);

  // Leaving the far side out doubles the speed of a software driver, and cannot be seen here.
  if (mesh.outward && SeesOnlyOutside(view, surface->bounds())) {
    glEnable(GL_CULL_FACE);
  } else {
    glDisable(GL_CULL_FACE);
  }
  glBindVertexArray(vertex_array);
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(mesh.corners.size()), GL_UNSIGNED_INT, nullptr);

  Image image;
  image.width = options.width;
  image.height = options.height;
  ReadBack(options, &image);
  TOUCHSTONE_RETURN_IF_ERROR(TakeGlError("drawing"));
  return image;
}

}  // namespace touchstone::image
