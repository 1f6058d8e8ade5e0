#include "server/diagnosis/images/photos_nothing_missing.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <iostream>

#include "server/base/test_tier.h"
#include "server/diagnosis/engine/uniform_p_values.h"
#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::images {
namespace {

engine::NothingMissing TestOf(const HiddenCamera& rig) {
  ThreadPool pool(2);
  DiagnosisContext context;
  context.pool = &pool;
  const DiagnosisInput input = MakePhotoInput(rig);
  const absl::StatusOr<Photographs> photographs = MakePhotographs(input, &pool);
  EXPECT_TRUE(photographs.ok()) << photographs.status();
  const absl::StatusOr<PhotoSearch> search = MakePhotoSearch(
      *photographs, *input.model, PhotoCandidates(input, *photographs), {1600, 2, 15}, context);
  EXPECT_TRUE(search.ok()) << search.status();
  const absl::StatusOr<engine::TriedPValues> tried = TryOnPhotographs(input, *photographs, *search, context);
  EXPECT_TRUE(tried.ok()) << tried.status();
  if (std::getenv("TRACE")) {
    Eigen::Index worst;
    tried->col(0).minCoeff(&worst);
    std::cout << "worst " << worst << " of " << tried->rows() << " p " << tried->col(0)[worst]
              << " lack of fit " << (*tried)(tried->rows() - 1, 0) << "\n";
  }
  return tried.ok() ? engine::WorstOfAll(*tried) : engine::NothingMissing();
}

HiddenCamera SmallCamera(uint64_t seed) {
  HiddenCamera rig;
  rig.objects = {"lat05", "lat15"};
  rig.photographs = 4;
  rig.side_px = 48;
  rig.seed = seed;
  return rig;
}

TEST(PhotosNothingMissing, HasAUniformPWhereNothingIsHidden) {
  TOUCHSTONE_SECOND_TIER("statistical: 500 sets");
  std::vector<double> p;
  const int sets = std::getenv("SETS") ? std::atoi(std::getenv("SETS")) : 500;
  for (int set = 0; set < sets; ++set) p.push_back(TestOf(SmallCamera(100 + set)).p);
  std::sort(p.begin(), p.end());
  for (int q = 0; q <= 10; ++q) std::cout << p[std::min<size_t>(q * p.size() / 10, p.size() - 1)] << " ";
  std::cout << "\n";
  engine::ExpectUniform(p);
}

TEST(PhotosNothingMissing, Trace) {
  HiddenCamera rig = SmallCamera(1);
  for (const auto& [name, value] :
       std::vector<std::pair<std::string, std::string>>{{"exposure", "stops=0"},
                                                        {"exposure", "stops=0.01"},
                                                        {"exposure", "stops=0.03"},
                                                        {"exposure", "stops=0.1"},
                                                        {"camera_rotation", "rotation_deg=0.02,0,0"},
                                                        {"camera_rotation", "rotation_deg=0.05,0,0"},
                                                        {"camera_rotation", "rotation_deg=0.2,0,0"},
                                                        {"defocus_blur", "sigma_px=0.3"},
                                                        {"defocus_blur", "sigma_px=0.6"},
                                                        {"radial_distortion", "k1=0.02"}}) {
    rig.hidden = {{name, {value}}};
    std::cout << name << " " << value << ": " << TestOf(rig).p << "\n";
  }
}

TEST(PhotosNothingMissing, Profile) {
  ThreadPool pool(2);
  DiagnosisContext context;
  context.pool = &pool;
  const auto now = [] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  };
  for (int side : {64, 160}) {
    HiddenCamera rig;
    rig.side_px = side;
    const DiagnosisInput input = MakePhotoInput(rig);
    double t = now();
    auto d = DiagnosePhotographs(input, context);
    std::cout << side << " px: diagnosis " << now() - t << " s, p " << d->nothing_missing->p << " over "
              << d->nothing_missing->hypotheses << "\n";
    auto photographs = MakePhotographs(input, &pool);
    auto search = MakePhotoSearch(*photographs, *input.model, PhotoCandidates(input, *photographs),
                                  {1600, 2, 15}, context);
    t = now();
    auto tried = TryOnPhotographs(input, *photographs, *search, context);
    std::cout << "  tried " << now() - t << " s\n";
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::images
