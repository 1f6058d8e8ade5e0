// Everything that can be set about a virtual source. Each field is a key of the TOML file and a flag of
// touchstone-server with the same name (underscores become dashes in flags).
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/threads/clock.h"
#include "server/image/renderers/renderer.h"
#include "server/service/options/access_options.h"
#include "server/service/options/limits.h"
#include "server/source/object_store.h"

namespace touchstone::service {

// "lat10=lat10.off", or with what the file does not say "cup=cup.off,fit_mm=150,up=y,unit=m,scale=2".
// Errors say what was found and what would be right.
absl::StatusOr<source::MeshSpec> ParseMeshSpec(const std::string& text);

// Every readable mesh file of a folder, sorted, named by its stem.
absl::StatusOr<std::vector<source::MeshSpec>> MeshSpecsOfFolder(const std::string& folder);

// Limits are options like all others; they have a table of their own.
struct ServerOptions : Limits {
  std::string listen = "127.0.0.1:50051";  // port 0: any free one; empty: no port (embedded)
  std::string metrics;   // HOST:PORT of counters and probes over HTTP (status_pages.h); empty: none
  AccessOptions access;  // who may connect there, and do what
  std::vector<source::MeshSpec> meshes;  // besides the five built-in supershapes
  int supershape_triangles = 20000;      // about; of each built-in
  std::string models_dir;                // where models are kept; empty: in memory
  std::string sessions_dir;              // where sessions are kept; empty: in memory
  std::string default_model = "nominal";
  int threads = 0;  // that simulate; 0: one per core
  image::RendererOptions renderer;
  double lease_window_s = 2;
  // Of leases, rates and time limits; no option of a process. It outlives the server.
  const Clock* clock = &SteadyClock();
};

}  // namespace touchstone::service
