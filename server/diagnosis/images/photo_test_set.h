// For tests: sets of photographs that the simulator itself makes under a model with something hidden. (The independent
// generator is tests/hidden_effects/.)
#pragma once

#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/diagnosis/input.h"
#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"
#include "server/image/photograph/simulate_photo.h"

namespace touchstone::diagnosis::images {

using NamedValues = std::vector<std::pair<std::string, std::vector<std::string>>>;

struct HiddenCamera {
  std::vector<std::string> objects = {"lat00", "lat10", "lat20"};
  int photographs = 8;  // of each object
  int side_px = 160;
  double sigma_grey = 2;
  NamedValues hidden, known;  // effects that the model lacks and has: {"exposure", {"stops=0.3"}}
  std::map<std::string, NamedValues> hidden_on;  // by object
  // Grey levels that are added to a pixel before its noise; null: none.
  std::function<double(int photograph, int column, int row, const image::Photo&, size_t pixel)> unlisted;
  uint64_t seed = 1;
};

inline model::Model WithPhotoEffects(model::Model model, const NamedValues& effects) {
  for (const auto& [name, values] : effects) {
    absl::StatusOr<model::Model> more = model::AddEffect(model, name, values, effects::Catalogue());
    EXPECT_TRUE(more.ok()) << more.status();
    if (more.ok()) model = *std::move(more);
  }
  return model;
}

inline std::shared_ptr<const geometry::Surface> PhotoTestSurface(const std::string& name) {
  static std::map<std::string, std::shared_ptr<const geometry::Surface>> made;
  std::shared_ptr<const geometry::Surface>& surface = made[name];
  if (surface == nullptr)
    surface =
        *geometry::Surface::Create(name, *geometry::MakeSupershape(*geometry::NamedSupershape(name), 4000));
  return surface;
}

inline DiagnosisInput MakePhotoInput(const HiddenCamera& rig) {
  DiagnosisInput input;
  auto set = std::make_shared<session::ImageSet>();
  set->origin = "photographs";
  const double focal_px = 0.5 * rig.side_px / std::tan(0.5 * 45 * M_PI / 180);
  set->camera.width_px = set->camera.height_px = rig.side_px;
  set->camera.fx_px = set->camera.fy_px = focal_px;
  set->camera.cx_px = set->camera.cy_px = 0.5 * rig.side_px;
  set->objects = rig.objects;
  set->has_session_time = true;
  const model::Model nominal =
      WithPhotoEffects(WithPhotoEffects(model::NominalModel(),
                                        {{"image_noise", {"sigma_grey=" + std::to_string(rig.sigma_grey)}}}),
                       rig.known);
  const model::Model real = WithPhotoEffects(nominal, rig.hidden);
  RandomStream random(rig.seed, RandomDomain::kTest);
  for (size_t object = 0; object < rig.objects.size(); ++object) {
    const auto surface = PhotoTestSurface(rig.objects[object]);
    input.surfaces[rig.objects[object]] = surface;
    const geometry::Bounds& bounds = surface->bounds();
    const auto own = rig.hidden_on.find(rig.objects[object]);
    const image::PhotoSimulator simulator(std::make_shared<const model::Model>(
        own == rig.hidden_on.end() ? real : WithPhotoEffects(real, own->second)));
    for (int n = 0; n < rig.photographs; ++n) {
      session::PhotographRow row;
      row.image = set->photographs.size();
      row.file = "p" + std::to_string(row.image) + ".png";
      row.object = static_cast<int>(object);
      const double azimuth = random.Uniform(0, 2 * M_PI), height = random.Uniform(-0.4, 0.9);
      const double distance = random.Uniform(1.5, 1.9) * bounds.DiagonalM();
      row.commanded.eye_m = bounds.Centre() + distance * Eigen::Vector3d(std::cos(azimuth) * std::cos(height),
                                                                         std::sin(azimuth) * std::cos(height),
                                                                         std::sin(height));
      row.commanded.at_m = bounds.Centre();
      row.session_time_s = 10.0 * static_cast<double>(row.image);
      image::PhotoRequest request;
      request.surface = surface;
      request.object = rig.objects[object];
      request.camera.eye_m = row.commanded.eye_m;
      request.camera.at_m = row.commanded.at_m;
      request.camera.up = row.commanded.up;
      request.lens.width = request.lens.height = rig.side_px;
      request.lens.fx_px = request.lens.fy_px = focal_px;
      request.lens.cx_px = request.lens.cy_px = 0.5 * rig.side_px;
      request.session_time_s = row.session_time_s;
      image::PhotoOutputs outputs;
      outputs.details = true;
      const absl::StatusOr<image::Photo> photo = simulator.Run(request, outputs, nullptr);
      EXPECT_TRUE(photo.ok()) << photo.status();
      for (size_t i = 0; i < photo->grey.size(); ++i) {
        double grey = photo->grey[i];
        const int column = static_cast<int>(i) % rig.side_px, at_row = static_cast<int>(i) / rig.side_px;
        if (rig.unlisted) grey += rig.unlisted(static_cast<int>(row.image), column, at_row, *photo, i);
        grey = std::min(std::max(grey, 0.0), 255.0) + rig.sigma_grey * random.Normal();
        row.pixels.push_back(static_cast<uint8_t>(std::min(std::max(std::lround(grey), 0L), 255L)));
      }
      set->photographs.push_back(std::move(row));
    }
  }
  input.images = set;
  input.model = std::make_shared<const model::Model>(nominal);
  return input;
}

}  // namespace touchstone::diagnosis::images
