// oblique_touch: prints when each finger meets the flat top of a supershape along a tilted approach, in microseconds. It
// ends with status 1 unless that is (standoff + x tan(tilt)) / speed for a finger at x along the lateral vector.
#include <cmath>
#include <cstdio>

#include "server/geometry/shapes/supershape.h"
#include "server/touch/batch_row.h"
#include "server/touch/simulate.h"

using namespace touchstone;

int main() {
  const geometry::TriangleMesh mesh = *geometry::MakeSupershape(*geometry::NamedSupershape("lat20"), 20'000);
  touch::CommandedTouch commanded;
  const double tilt_rad = 0.2;
  commanded.target_m.z() = geometry::ComputeBounds(mesh).max_m.z();
  commanded.approach = {std::sin(tilt_rad), 0, -std::cos(tilt_rad)};
  commanded.lateral = {std::cos(tilt_rad), 0, std::sin(tilt_rad)};

  const touch::TouchSimulator simulator(std::make_shared<const model::Model>(model::NominalModel()));
  effects::TouchBatch batch;
  simulator.Prepare(1, &batch);
  batch.surface = *geometry::Surface::Create("lat20", mesh);
  touch::SetTouch(commanded, 0, 0, &batch);
  touch::TouchWorkspace workspace;
  bool as_expected = simulator.Run(&batch, &workspace).ok();

  for (int finger = 0; finger < batch.fingers(); ++finger) {
    const double time_s = batch.reported_time_s[batch.At(finger, 0)];
    const double x_m = batch.FingerPosition(finger) * batch.spacing_m;
    const double expected_s = (commanded.standoff_m + x_m * std::tan(tilt_rad)) / commanded.speed_m_s;
    std::printf("%.3f\n", 1e6 * time_s);
    as_expected = as_expected && std::fabs(time_s - expected_s) < 1e-6;
  }
  return as_expected ? 0 : 1;
}
