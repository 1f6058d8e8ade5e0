#include "tests/hidden_effects/score/arms/test_objects.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"
#include "server/effects/all_effects.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::hidden {

constexpr uint64_t kTriangles = 65'000;

TestObjects LoadTestObjects(const std::string& mesh_folder) {
  TestObjects objects;
  for (const std::string& name : geometry::SupershapeNames()) {
    const std::string path = mesh_folder + "/" + name + ".off";
    const bool on_disk = std::filesystem::exists(path);
    auto mesh = on_disk ? geometry::ReadMeshFile(path)
                        : geometry::MakeSupershape(geometry::NamedSupershape(name).value(), kTriangles);
    if (!mesh.ok()) {
      std::cerr << mesh.status() << '\n';
      std::abort();
    }
    objects.solids.push_back(
        std::make_shared<Solid>(name, on_disk ? ReadTriangles(path) : SupershapeTriangles(name, kTriangles)));
    objects.surfaces[name] = geometry::Surface::Create(name, *std::move(mesh)).value();
  }
  return objects;
}

absl::StatusOr<diagnosis::DiagnosisInput> InputFor(const std::string& csv, const std::string& model_yaml,
                                                   const TestObjects& objects) {
  TOUCHSTONE_ASSIGN_OR_RETURN(session::MeasurementSet set, session::ParseMeasurementSet(csv, "hidden"));
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model,
                              model::ParseModel(model_yaml, "nominal.yaml", effects::Catalogue()));
  diagnosis::DiagnosisInput input;
  input.set = std::make_shared<const session::MeasurementSet>(std::move(set));
  input.model = std::make_shared<const model::Model>(std::move(model));
  // As with --mesh-dir: the meshes that the file does not name are there too.
  input.surfaces = objects.surfaces;
  return input;
}

absl::StatusOr<diagnosis::DiagnosisInput> InputFor(const Set& set, const TestObjects& objects) {
  return InputFor(set.csv, set.model_yaml, objects);
}

absl::StatusOr<double> ExactRmseUs(const Set& set, const std::string& model_yaml,
                                   const TestObjects& objects) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::DiagnosisInput input, InputFor(set.csv, model_yaml, objects));
  TOUCHSTONE_ASSIGN_OR_RETURN(diagnosis::touches::Observations observations,
                              diagnosis::touches::MakeObservations(input));
  // The exact times in place of the reported ones.
  for (int k = 0; k < observations.size(); ++k)
    for (int i = 0; i < observations.fingers; ++i)
      observations.time_s[k * observations.fingers + i] =
          set.exact_time_us[observations.row[k] * observations.fingers + i] * kSecondsPerMicrosecond;
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::touches::Prediction prediction,
                              diagnosis::touches::Predict(observations, *input.model, false, false, nullptr));
  return kMicrosecondsPerSecond *
         diagnosis::touches::Rmse(observations, diagnosis::touches::Residuals(observations, prediction));
}

}  // namespace touchstone::hidden
