// touches PLAN.csv MODEL.yaml MESH SEED: the measurement file that `touchstone touch` prints for the same.
#include <iostream>

#include "client/source/dataset/measurement_csv.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"
#include "server/geometry/files/mesh_file.h"
#include "server/service/core/convert.h"
#include "server/touch/batch_row.h"
#include "server/touch/simulate.h"

using namespace touchstone;

absl::Status PrintTouches(const std::string& plan_file, const std::string& model_file,
                          const std::string& mesh_file, uint64_t seed) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string plan, ReadFile(plan_file));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<client::MeasuredTouch> touches,
                              client::ParseMeasurements(plan, plan_file));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string yaml, ReadFile(model_file));
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, model::ParseModel(yaml, model_file, effects::Catalogue()));
  TOUCHSTONE_ASSIGN_OR_RETURN(geometry::TriangleMesh mesh, geometry::ReadMeshFile(mesh_file));

  const touch::TouchSimulator simulator(std::make_shared<const model::Model>(std::move(model)));
  effects::TouchBatch batch;
  simulator.Prepare(static_cast<int>(touches.size()), &batch);
  TOUCHSTONE_ASSIGN_OR_RETURN(batch.surface, geometry::Surface::Create(mesh_file, std::move(mesh)));
  batch.seed = seed;
  for (int k = 0; k < batch.size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const touch::CommandedTouch commanded,
                                service::FromProto(touches[k].commanded, plan_file));
    touch::SetTouch(commanded, k, k, &batch);
  }
  touch::TouchWorkspace workspace;
  TOUCHSTONE_RETURN_IF_ERROR(simulator.Run(&batch, &workspace));
  for (int k = 0; k < batch.size(); ++k)
    for (int finger = 0; finger < batch.fingers(); ++finger)
      touches[k].time_s.push_back(batch.reported_time_s[batch.At(finger, k)]);
  std::cout << client::FormatMeasurements(touches);
  return absl::OkStatus();
}

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const absl::Status status = PrintTouches(argv[1], argv[2], argv[3], std::stoull(argv[4]));
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
