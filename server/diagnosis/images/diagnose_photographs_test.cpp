#include "server/diagnosis/images/diagnose_photographs.h"

#include <gtest/gtest.h>

#include <iostream>

#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::images {
namespace {

PhotographDiagnosis Diagnosed(const DiagnosisInput& input) {
  ThreadPool pool(2);
  DiagnosisContext context;
  context.pool = &pool;
  if (getenv("D_COUNT")) context.progress = [](const std::string& s, double d) { fprintf(stderr, "%s %g cpu %ld\n", s.c_str(), d, (long)(clock() / 1000)); return true; };
  const absl::StatusOr<PhotographDiagnosis> diagnosis = DiagnosePhotographs(input, context);
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  if (!diagnosis.ok()) return {};
  std::cout << "verdict " << static_cast<int>(diagnosis->verdict) << ", floor " << diagnosis->noise_floor.sigma_grey
            << ", rmse " << diagnosis->initial->rmse_grey << " -> "
            << (diagnosis->final ? diagnosis->final->rmse_grey : 0) << ", p "
            << (diagnosis->final ? diagnosis->final->lack_of_fit_p : 0) << ", " << diagnosis->duration_s << " s\n";
  for (const PhotographStep& step : diagnosis->steps) {
    std::cout << "  + " << step.effect << " " << step.probability << " gain " << step.gain_nats;
    for (const auto& e : step.parameters)
      std::cout << "  " << e.object << " " << e.name << e.entry << " = " << e.value << " +- " << e.std_error;
    for (const std::string& other : step.equivalent) std::cout << " or " << other;
    std::cout << "\n";
  }
  for (const auto& refit : diagnosis->refitted) {
    std::cout << "  refit " << refit.effect;
    for (const auto& e : refit.parameters) std::cout << "  " << e.name << e.entry << " = " << e.value << " +- " << e.std_error;
    std::cout << "\n";
  }
  if (diagnosis->unexplained) {
    std::cout << "  unexplained: " << diagnosis->unexplained->words << "\n";
    for (const auto& c : diagnosis->unexplained->covariates) std::cout << "    " << c.name << " p " << c.p << "\n";
  }
  return *diagnosis;
}

TEST(DiagnosePhotographs, FindsNothingWhereNothingIsMissing) {
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput({}));
  EXPECT_EQ(d.verdict, selection::Verdict::kAdequate);
  EXPECT_TRUE(d.steps.empty());
}

struct Hidden {
  const char* effect;
  std::vector<std::string> values;
};

class OneHidden : public ::testing::TestWithParam<Hidden> {};

TEST_P(OneHidden, IsNamedWithItsValue) {
  HiddenCamera rig;
  rig.hidden = {{GetParam().effect, GetParam().values}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, selection::Verdict::kMissingEffects);
  ASSERT_EQ(d.steps.size(), 1u);
  EXPECT_EQ(d.steps[0].effect, GetParam().effect);
}

INSTANTIATE_TEST_SUITE_P(Photographs, OneHidden,
                         ::testing::Values(Hidden{"exposure", {"stops=0.1"}}, Hidden{"focal_error", {"relative=0.01"}},
                                           Hidden{"radial_distortion", {"k1=0.05"}},
                                           Hidden{"camera_rotation", {"rotation_deg=0.2,-0.3,0.4"}},
                                           Hidden{"camera_translation", {"offset_mm=1,-2,0.5"}},
                                           Hidden{"principal_point", {"offset_px=2,-1"}},
                                           Hidden{"gamma", {"exponent=1.1"}}, Hidden{"vignetting", {"strength=0.2"}},
                                           Hidden{"defocus_blur", {"sigma_px=0.8"}},
                                           Hidden{"motion_blur", {"length_px=3", "angle_deg=60"}},
                                           Hidden{"light_position", {"offset_mm=20,0,-10"}},
                                           Hidden{"ambient_light", {"level=0.04"}},
                                           Hidden{"cast_shadow", {"strength=0.4"}},
                                           Hidden{"specular", {"strength=0.2", "exponent=30"}},
                                           Hidden{"background_level", {"grey=12"}},
                                           Hidden{"object_pose", {"translation_mm=1,-1,0.5", "rotation_deg=0.3,0,-0.5"}},
                                           Hidden{"object_scale", {"relative=0.01"}}),
                         [](const auto& info) { return std::string(info.param.effect); });

}  // namespace
}  // namespace touchstone::diagnosis::images
