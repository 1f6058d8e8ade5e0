// nearest_touch: prints when each finger meets a supershape of 150 mm from 100 mm above, in microseconds. It ends with
// status 1 unless the middle finger comes first, after the time that its way takes.
#include <cmath>
#include <cstdio>

#include "server/geometry/supershape.h"
#include "server/touch/batch_row.h"
#include "server/touch/simulate.h"

using namespace touchstone;

int main() {
  const auto shape = geometry::NamedSupershape("lat20");
  const auto mesh = geometry::MakeSupershape(*shape, 20'000);
  const double top_m = geometry::ComputeBounds(*mesh).max_m.z();

  const touch::TouchSimulator simulator(std::make_shared<const model::Model>(model::NominalModel()));
  effects::TouchBatch batch;
  simulator.Prepare(1, &batch);
  batch.surface = *geometry::Surface::Create("lat20", *mesh);
  touch::CommandedTouch commanded;
  commanded.standoff_m = 0.1 + top_m;
  touch::SetTouch(commanded, 0, 0, &batch);
  touch::TouchWorkspace workspace;
  const absl::Status status = simulator.Run(&batch, &workspace);
  if (!status.ok()) return 1;

  for (int finger = 0; finger < batch.fingers(); ++finger)
    std::printf("%.3f\n", 1e6 * batch.reported_time_s[batch.At(finger, 0)]);
  const double expected_s = 0.1 / commanded.speed_m_s;
  return batch.first_finger[0] == 1 && std::fabs(batch.reported_time_s[1] - expected_s) < 1e-6 ? 0 : 1;
}
