// Everything that can be set about a virtual source. Each field is a key of the TOML file and a flag of
// touchstone-server with the same name (underscores become dashes in flags).
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/image/renderer.h"
#include "server/service/access_options.h"
#include "server/source/object_store.h"
#include "server/source/request_checks.h"

namespace touchstone::service {

// "lat10=lat10.off", or with what the file does not say "cup=cup.off,fit_mm=150,up=y,unit=m,scale=2".
// Errors say what was found and what would be right.
absl::StatusOr<source::MeshSpec> ParseMeshSpec(const std::string& text);

// Every readable mesh file of a folder, sorted, named by its stem.
absl::StatusOr<std::vector<source::MeshSpec>> MeshSpecsOfFolder(const std::string& folder);

struct ServerOptions {
  std::string listen = "127.0.0.1:50051";  // port 0: any free one; empty: no port (embedded)
  AccessOptions access;                    // who may connect there, and do what
  std::vector<source::MeshSpec> meshes;    // besides the five built-in supershapes
  int supershape_triangles = 20000;        // about; of each built-in
  std::string models_dir;                  // where models are kept; empty: in memory
  std::string sessions_dir;                // where sessions are kept; empty: in memory
  std::string default_model = "nominal";
  int threads = 0;  // that simulate; 0: one per core
  image::RendererOptions renderer;
  // Limits: every one in this place.
  int max_batch_size = 65536;
  int max_touches_per_request = 100000;
  int max_images_per_request = 1000;
  int max_indices_per_request = 100000;  // samples asked for one by one
  int max_streams = 64;                  // dataset streams at once; one more is RESOURCE_EXHAUSTED
  int max_message_mib = 256;
  int max_session_mib = 1024;   // one stored session
  int max_sessions_mib = 4096;  // all stored sessions together, and all that are being sent at once
  int max_diagnoses = 4;        // compared, diagnosed or proposed for at once; one more is RESOURCE_EXHAUSTED
  int max_proposed_touches = 1000;
  double lease_window_s = 2;
  double drain_s = 10;  // what running calls get after SIGTERM

  source::SourceLimits Limits() const {
    return {max_touches_per_request, max_images_per_request, max_batch_size, max_indices_per_request};
  }
};

}  // namespace touchstone::service
