#include "server/image/renderers/egl_device.h"

#include <cstdlib>
#include <cstring>
#include <mutex>
#include <thread>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>

namespace touchstone::image {
namespace {

constexpr EGLint kMaxDevices = 64;

const char* EglErrorText(EGLint error) {
  switch (error) {
    case EGL_SUCCESS:
      return "no reason given";
    case EGL_NOT_INITIALIZED:
      return "the driver could not be initialised (EGL_NOT_INITIALIZED)";
    case EGL_BAD_ACCESS:
      return "no access to the device (EGL_BAD_ACCESS)";
    case EGL_BAD_ALLOC:
      return "out of memory or of contexts (EGL_BAD_ALLOC)";
    case EGL_BAD_MATCH:
      return "the driver does not offer this (EGL_BAD_MATCH)";
    case EGL_BAD_CONFIG:
      return "no fitting frame buffer configuration (EGL_BAD_CONFIG)";
    case EGL_BAD_ATTRIBUTE:
      return "the driver does not know an attribute (EGL_BAD_ATTRIBUTE)";
    case EGL_BAD_PARAMETER:
      return "the driver refuses a parameter (EGL_BAD_PARAMETER)";
    case EGL_BAD_DISPLAY:
      return "no such display (EGL_BAD_DISPLAY)";
    case EGL_CONTEXT_LOST:
      return "the device was lost (EGL_CONTEXT_LOST)";
    default:
      return "unknown EGL error";
  }
}

bool Has(const char* extensions, const char* name) {
  // Whole words only: names are prefixes of one another.
  const size_t length = std::strlen(name);
  for (const char* at = extensions; at != nullptr && (at = std::strstr(at, name)) != nullptr; at += length) {
    const bool starts = at == extensions || at[-1] == ' ';
    if (starts && (at[length] == ' ' || at[length] == '\0')) return true;
  }
  return false;
}

std::string Text(const char* text) {
  return text == nullptr ? std::string() : std::string(text);
}

// eglInitialize, with the reason if it fails.
void Initialise(EGLDisplay egl_display, EglDisplay* result) {
  if (egl_display == EGL_NO_DISPLAY) {
    result->problem = absl::StrCat("EGL gives no display: ", EglErrorText(eglGetError()));
    return;
  }
  EGLint major = 0, minor = 0;
  if (!eglInitialize(egl_display, &major, &minor)) {
    result->problem = absl::StrCat("EGL cannot be initialised: ", EglErrorText(eglGetError()));
    return;
  }
  result->version = 10 * major + minor;
  result->vendor = Text(eglQueryString(egl_display, EGL_VENDOR));
  const char* extensions = eglQueryString(egl_display, EGL_EXTENSIONS);
  if (!Has(extensions, "EGL_KHR_surfaceless_context")) {
    result->problem = "the driver cannot draw without a window (no EGL_KHR_surfaceless_context)";
    return;
  }
  result->display = egl_display;
}

std::vector<EglDisplay> OpenDisplays() {
  std::vector<EglDisplay> displays;
  if (!epoxy_has_egl()) {
    displays.push_back({nullptr, 0, false, "", "", "libEGL is not installed (Debian: libegl1 and a driver)"});
    return displays;
  }
  // libepoxy ends the process where it finds neither when the first function of OpenGL is called.
  if (::dlopen("libOpenGL.so.0", RTLD_LAZY) == nullptr && ::dlopen("libGL.so.1", RTLD_LAZY) == nullptr) {
    displays.push_back({nullptr, 0, false, "", "", "libOpenGL is not installed (Debian: libopengl0)"});
    return displays;
  }
  // llvmpipe: its own threads only get in the way of ours. Read by the driver when its first context is made.
  setenv("LP_NUM_THREADS", "0", /*overwrite=*/0);
  // Failures are described in `problem`; Mesa would print its own warnings on stderr besides.
  setenv("EGL_LOG_LEVEL", "fatal", /*overwrite=*/0);

  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const bool enumerates = Has(client, "EGL_EXT_device_base") ||
                          (Has(client, "EGL_EXT_device_enumeration") && Has(client, "EGL_EXT_device_query"));
  if (enumerates && Has(client, "EGL_EXT_platform_device")) {
    EGLDeviceEXT devices[kMaxDevices];
    EGLint count = 0;
    if (!eglQueryDevicesEXT(kMaxDevices, devices, &count)) count = 0;
    for (EGLint i = 0; i < count; ++i) {
      EglDisplay display;
      const char* extensions = eglQueryDeviceStringEXT(devices[i], EGL_EXTENSIONS);
      display.software = Has(extensions, "EGL_MESA_device_software");
      if (Has(extensions, "EGL_EXT_device_drm"))
        display.driver = Text(eglQueryDeviceStringEXT(devices[i], EGL_DRM_DEVICE_FILE_EXT));
      if (display.driver.empty()) display.driver = display.software ? "software" : "device";
      Initialise(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr), &display);
      displays.push_back(std::move(display));
    }
  }
  if (Has(client, "EGL_MESA_platform_surfaceless")) {
    EglDisplay display;
    display.driver = "surfaceless platform";
    Initialise(eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr),
               &display);
    displays.push_back(std::move(display));
  }
  if (displays.empty()) {
    displays.push_back({nullptr, 0, false, "", "",
                        "EGL offers neither devices nor a surfaceless platform; is a driver installed "
                        "(Debian: libegl-mesa0, or the maker's)?"});
  }
  return displays;
}

}  // namespace

const std::vector<EglDisplay>& EglDisplays() {
  static const std::vector<EglDisplay>& displays = *new std::vector<EglDisplay>(OpenDisplays());
  return displays;
}

absl::StatusOr<std::unique_ptr<EglContext>> EglContext::Create(const EglDisplay& display) {
  if (display.display == nullptr) return absl::UnavailableError(display.problem);
  if (!eglBindAPI(EGL_OPENGL_API)) {
    return absl::UnavailableError(
        absl::StrCat("the driver has OpenGL ES only, no OpenGL: ", EglErrorText(eglGetError())));
  }
  // A context that is never bound to a surface needs no configuration where the driver says so.
  EGLConfig config = nullptr;
  if (!Has(eglQueryString(display.display, EGL_EXTENSIONS), "EGL_KHR_no_config_context")) {
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_PBUFFER_BIT,
                             EGL_NONE};
    EGLint count = 0;
    if (!eglChooseConfig(display.display, wanted, &config, 1, &count) || count < 1)
      return absl::UnavailableError("the driver offers no configuration for OpenGL without a window");
  }
  std::vector<EGLint> attributes = {EGL_CONTEXT_MAJOR_VERSION,       3,
                                    EGL_CONTEXT_MINOR_VERSION,       3,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT};
  // Core in EGL 1.5. Without it a driver may end the process when its device is lost, or draw on as if nothing were.
  const bool tells_loss = display.version >= 15;
  if (tells_loss)
    attributes.insert(attributes.end(),
                      {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_LOSE_CONTEXT_ON_RESET});
  attributes.push_back(EGL_NONE);
  EGLContext context = eglCreateContext(display.display, config, EGL_NO_CONTEXT, attributes.data());
  if (context == EGL_NO_CONTEXT && tells_loss) {  // the driver does not do it
    attributes.resize(6);
    attributes.push_back(EGL_NONE);
    context = eglCreateContext(display.display, config, EGL_NO_CONTEXT, attributes.data());
  }
  if (context == EGL_NO_CONTEXT)
    return absl::UnavailableError(absl::StrCat("no OpenGL 3.3 core context: ", EglErrorText(eglGetError())));
  if (!eglMakeCurrent(display.display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
    const EGLint error = eglGetError();
    eglDestroyContext(display.display, context);
    return absl::UnavailableError(
        absl::StrCat("the OpenGL context cannot be made current without a window: ", EglErrorText(error)));
  }
  std::unique_ptr<EglContext> made(new EglContext(display.display, context));
  made->tells_loss_ = epoxy_gl_version() >= 45 || epoxy_has_gl_extension("GL_KHR_robustness");
  return made;
}

bool EglContext::Lost() const {
  return tells_loss_ && glGetGraphicsResetStatus() != GL_NO_ERROR;
}

EglContext::~EglContext() {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
}

bool IsSoftwareRenderer(const std::string& gl_renderer) {
  for (const char* name : {"llvmpipe", "softpipe", "swrast", "SWR", "Software Rasterizer"})
    if (absl::StrContains(gl_renderer, name)) return true;
  return false;
}

std::vector<EglDevice> ListEglDevices() {
  std::vector<EglDevice> devices;
  // On a thread of its own: the caller may have a context current that must stay so.
  std::thread([&devices] {
    const std::vector<EglDisplay>& displays = EglDisplays();
    for (size_t i = 0; i < displays.size(); ++i) {
      EglDevice device;
      device.index = static_cast<int>(i);
      device.vendor = displays[i].vendor;
      device.name = displays[i].driver;
      device.software = displays[i].software;
      const auto context = EglContext::Create(displays[i]);
      if (context.ok()) {
        device.renders = true;
        device.vendor = Text(reinterpret_cast<const char*>(glGetString(GL_VENDOR)));
        device.name = Text(reinterpret_cast<const char*>(glGetString(GL_RENDERER)));
        device.software = device.software || IsSoftwareRenderer(device.name);
      } else {
        device.problem = std::string(context.status().message());
      }
      devices.push_back(std::move(device));
    }
  }).join();
  return devices;
}

}  // namespace touchstone::image
