#include "server/service/rpc/server_flags.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <vector>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/core/resources.h"
#include "server/service/options/option_table.h"

namespace touchstone::service {
namespace {

// What the user says of meshes and renderers before it is checked.
struct RawServerFlags {
  std::vector<std::string> mesh, mesh_dir;
  std::string renderer = "auto";
};

std::vector<Option> OptionsOf(ServerFlags* flags, RawServerFlags* raw) {
  ServerOptions& o = flags->options;
  std::vector<Option> options = {
      {"listen", "Address to listen on, HOST:PORT; port 0: any free one", &o.listen},
      {"mesh",
       "Serve a mesh file, NAME=FILE[,unit=mm|cm|m|inch][,up=z|y|x][,scale=S][,fit_mm=L]; may be repeated",
       &raw->mesh},
      {"mesh_dir",
       "Serve every OFF, OBJ, STL and PLY file of a folder, in mm and z up, named by its stem; may be "
       "repeated",
       &raw->mesh_dir},
      {"supershape_triangles", "About how many triangles each built-in supershape has",
       &o.supershape_triangles},
      {"models_dir", "Folder that keeps models; replicas may share it (default: memory)", &o.models_dir},
      {"sessions_dir", "Folder that keeps sessions; replicas may share it (default: memory)",
       &o.sessions_dir},
      {"default_model", "Model used when a request names none: a name, or a .yaml file", &o.default_model},
      {"threads", "Threads that simulate; 0: one a core", &o.threads},
      {"renderer", "auto (the faster one), egl or cpu", &raw->renderer},
      {"egl_device", "Index of the EGL device (touchstone doctor lists them); -1: the first that renders",
       &o.renderer.egl_device},
      {"lease_window_s", "Seconds within which a lease must be renewed", &o.lease_window_s},
      {"metrics", "Counters for Prometheus and probes over HTTP, HOST:PORT (default: none)", &o.metrics},
      {"log_level", "trace, debug, info, warn, error or off", &flags->log_level},
      {"log_json", "Log lines as JSON", &flags->log_json},
  };
  const std::vector<Option> access = AccessFlags(&o.access);
  options.insert(options.begin() + 1, access.begin(), access.end());
  AppendLimits(&o, &options);
  return options;
}

absl::Status Resolve(const RawServerFlags& raw, ServerFlags* flags) {
  ServerOptions& options = flags->options;
  for (const std::string& folder : raw.mesh_dir) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<source::MeshSpec> sources, MeshSpecsOfFolder(folder));
    options.meshes.insert(options.meshes.end(), sources.begin(), sources.end());
  }
  for (const std::string& text : raw.mesh) {
    TOUCHSTONE_ASSIGN_OR_RETURN(source::MeshSpec source, ParseMeshSpec(text));
    options.meshes.push_back(std::move(source));
  }
  if (raw.renderer == "egl") {
    options.renderer.kind = image::RendererKind::kEgl;
  } else if (raw.renderer == "cpu") {
    options.renderer.kind = image::RendererKind::kCpu;
  } else if (raw.renderer != "auto") {
    return absl::InvalidArgumentError(
        absl::StrCat("renderer = '", raw.renderer, "'", DidYouMean(raw.renderer, {"auto", "egl", "cpu"})));
  }
  return CheckLogLevel(flags->log_level);
}

}  // namespace

absl::Status ApplyToml(const std::string& text, const std::string& origin, ServerFlags* flags) {
  RawServerFlags raw;
  TOUCHSTONE_RETURN_IF_ERROR(ReadToml(text, origin, OptionsOf(flags, &raw), {}));
  return Resolve(raw, flags);
}

absl::StatusOr<ServerFlags> ParseServerFlags(int argc, const char* const* argv) {
  ServerFlags flags;
  RawServerFlags raw;
  const std::vector<Option> options = OptionsOf(&flags, &raw);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const CommandLine line,
      ReadCommandLine(
          "touchstone-server",
          "Examples:\n"
          "  touchstone-server\n"
          "  touchstone-server --listen 127.0.0.1:50051 --mesh cup=cup.off,fit_mm=150,up=y\n"
          "  touchstone-server --listen 0.0.0.0:50051 --tls-cert server.pem --tls-key server.key "
          "--token-file tokens\n"
          "  touchstone-server --config server.toml --threads 8\n"
          "\nThe virtual source: simulates touches, renders images and streams datasets over gRPC.\n"
          "It prints 'listening on HOST:PORT' when it is ready and drains on SIGTERM.",
          "TOML file; its keys are the flags below with underscores (listen = \"127.0.0.1:0\")", options,
          argc, argv));
  flags.done = line.done;
  if (line.done) return flags;
  TOUCHSTONE_RETURN_IF_ERROR(Resolve(raw, &flags));
  return flags;
}

}  // namespace touchstone::service
