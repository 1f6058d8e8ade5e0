// A graphics device that is reset or gone while a program draws: preloaded into it (LD_PRELOAD), this answers for the driver
// where OpenGL and EGL tell of it. The driver is a real one. A file of two 32-bit numbers, which TOUCHSTONE_LOST_DEVICE names, says how many resets are
// still to be told, and whether the device is gone (no new context). A context that is refused tells of all resets.
#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

namespace {

struct Device {
  std::atomic<int32_t> resets, gone;
};
Device* device = nullptr;

// libepoxy calls through variables; the first call finds the driver's function and puts it there.
template <typename Function>
struct Replaced {
  Function* variable = nullptr;
  Function driver = nullptr, ours = nullptr;
  bool found = false;  // the driver's function

  void Replace(const char* name, Function function) {
    variable = static_cast<Function*>(dlsym(RTLD_DEFAULT, name));
    if (variable == nullptr) return;
    driver = *variable, ours = function;
    *variable = ours;
  }
  template <typename... Arguments>
  auto Call(Arguments... arguments) {
    if (found) return driver(arguments...);
    *variable = driver;  // looks whether it still stands there
    const auto result = driver(arguments...);
    driver = *variable, *variable = ours, found = true;
    return result;
  }
};
Replaced<PFNGLGETGRAPHICSRESETSTATUSPROC> reset_status;
Replaced<PFNEGLCREATECONTEXTPROC> create_context;

GLenum ResetStatus() {
  int32_t left = device->resets;
  while (left > 0 && !device->resets.compare_exchange_weak(left, left - 1)) {
  }
  return left > 0 ? GL_UNKNOWN_CONTEXT_RESET : reset_status.Call();
}

EGLContext CreateContext(EGLDisplay display, EGLConfig config, EGLContext share, const EGLint* attributes) {
  if (device->gone == 0) return create_context.Call(display, config, share, attributes);
  device->resets = 0;
  return EGL_NO_CONTEXT;
}

__attribute__((constructor)) void Begin() {
  const char* path = std::getenv("TOUCHSTONE_LOST_DEVICE");
  const int file = path == nullptr ? -1 : open(path, O_RDWR | O_CLOEXEC);
  void* bytes =
      file < 0 ? MAP_FAILED : mmap(nullptr, sizeof(Device), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (bytes == MAP_FAILED) {
    std::fprintf(stderr, "TOUCHSTONE_LOST_DEVICE = '%s': must name a file of eight bytes\n",
                 path == nullptr ? "" : path);
    _exit(2);
  }
  close(file);
  device = static_cast<Device*>(bytes);
  reset_status.Replace("epoxy_glGetGraphicsResetStatus", ResetStatus);
  create_context.Replace("epoxy_eglCreateContext", CreateContext);
}

}  // namespace
