// EGL devices and OpenGL contexts without any window system. Part of the EGL renderer only.
//
// A display (EGL's handle of a device) belongs to the whole process: it is initialised once and never
// terminated, since termination would take the contexts of all other users in the process along.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/image/renderers/renderer.h"

namespace touchstone::image {

// A device that could be asked for a context, whether or not it gives one.
struct EglDisplay {
  void* display = nullptr;  // EGLDisplay; null: see problem
  int version = 0;          // of EGL: 15 is 1.5
  bool software = false;
  std::string vendor;
  std::string driver;   // the driver's file, or the platform
  std::string problem;  // in words, if there is no display
};

// Every device that EGL enumerates, and after them Mesa's surfaceless platform where it exists. The position
// is the index of RendererOptions::egl_device. Opened at the first call, the same ever after.
const std::vector<EglDisplay>& EglDisplays();

// An OpenGL 3.3 core context. To be used and destroyed on the thread that created it.
class EglContext {
 public:
  // The context is current on return.
  static absl::StatusOr<std::unique_ptr<EglContext>> Create(const EglDisplay& display);
  ~EglContext();
  // Whether the device was reset or is gone since the context was made: nothing that was drawn is to be trusted, and
  // only a new context can draw again. False where the driver does not tell.
  bool Lost() const;
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

 private:
  EglContext(void* display, void* context) : display_(display), context_(context) {}
  void* display_;
  void* context_;
  bool tells_loss_ = false;
};

// Whether this GL_RENDERER draws on the processor.
bool IsSoftwareRenderer(const std::string& gl_renderer);

}  // namespace touchstone::image
