#include "server/diagnosis/checks/photographs/photo_mistake_list.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <cmath>

#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::diagnosis::checks {
namespace {

using Mirror = session::ImageSetFix::Mirror;

CandidateMistake OfSet(ProblemKind kind, std::string detail, std::string words) {
  CandidateMistake mistake;
  mistake.kind = kind;
  mistake.detail = std::move(detail);
  mistake.words = std::move(words);
  return mistake;
}

void AddPictures(std::vector<CandidateMistake>* list) {
  for (const bool sideways : {true, false}) {
    CandidateMistake mistake =
        OfSet(ProblemKind::kMirrored, sideways ? "left <-> right" : "top <-> bottom",
              absl::StrCat("the pictures are mirrored, ", sideways ? "left to right" : "top to bottom"));
    mistake.fix.mirror = sideways ? Mirror::kLeftRight : Mirror::kUpDown;
    list->push_back(mistake);
  }
  for (const int turn_deg : {180, 90, 270}) {
    CandidateMistake mistake =
        OfSet(ProblemKind::kRotated, absl::StrCat(turn_deg, " deg"),
              turn_deg == 180 ? std::string("the pictures stand on their heads")
                              : absl::StrCat("the pictures are turned by 90 deg ",
                                             turn_deg == 90 ? "counter-clockwise" : "clockwise"));
    mistake.fix.rotate_deg = turn_deg;
    list->push_back(mistake);
    // Turned and mirrored at once: rows and columns exchanged.
    if (turn_deg == 180) continue;
    mistake.detail += ", mirrored";
    mistake.words = "rows and columns of the pictures are exchanged";
    mistake.fix.mirror = Mirror::kLeftRight;
    list->push_back(mistake);
  }
}

void AddRows(std::vector<CandidateMistake>* list) {
  for (const int shift : {1, -1, 2, -2}) {
    CandidateMistake mistake =
        OfSet(ProblemKind::kRowShift, absl::StrCat(shift > 0 ? "+" : "", shift),
              absl::StrCat("the pictures belong ", std::abs(shift) == 1 ? "one row" : "two rows", " further ",
                           shift > 0 ? "down" : "up", " in images.csv"));
    mistake.fix.shift_rows = shift;
    list->push_back(mistake);
  }
}

void AddUnits(std::vector<CandidateMistake>* list) {
  struct Length {
    double factor;
    const char *unit, *told;
  };
  for (const Length& length : {Length{1000, "m", "x 1000"},
                               {25.4, "inch", "x 25.4"},
                               {10, "cm", "x 10"},
                               {0.001, "um", "x 1/1000"}}) {
    CandidateMistake mistake =
        OfSet(ProblemKind::kUnitsLength, length.told,
              absl::StrCat("eye and at are in ", length.unit, " where mm are expected"));
    mistake.fix.scale_lengths = length.factor;
    list->push_back(mistake);
  }
}

void AddAxes(std::vector<CandidateMistake>* list) {
  CandidateMistake reversed =
      OfSet(ProblemKind::kUpAxis, "up reversed", "the camera's up points down in every picture");
  reversed.fix.reverse_up = true;
  list->push_back(reversed);
  // Of the camera alone.
  for (int axis = 2; axis >= 0; --axis)
    for (const double sign : {1.0, -1.0}) {
      Eigen::Vector3d up = Eigen::Vector3d::Zero();
      up[axis] = sign;
      const std::string name = absl::StrCat(sign < 0 ? "-" : "", std::string(1, "xyz"[axis]));
      CandidateMistake mistake = OfSet(ProblemKind::kUpAxis, absl::StrCat("camera up = ", name),
                                       absl::StrCat("the camera's up is ", name, " in every picture"));
      mistake.fix.up = up;
      list->push_back(mistake);
    }
  // Of the frame: poses told in one whose up is another axis, and its kin.
  for (const char* axes : {"x,-z,y", "x,z,-y", "z,x,y", "y,z,x", "-z,y,x", "z,y,-x", "-y,x,z", "y,-x,z",
                           "-x,-y,z", "x,-y,-z", "-x,y,-z", "y,x,z", "x,y,-z", "x,z,y", "-x,y,z", "x,-y,z"}) {
    CandidateMistake mistake =
        OfSet(ProblemKind::kUpAxis, axes,
              absl::StrCat("the poses are in another frame: the object's x, y, z are their ", axes));
    mistake.fix.axes = *session::ParseAxes(axes);
    list->push_back(mistake);
  }
  CandidateMistake mistake = OfSet(ProblemKind::kEyeAt, "eye <-> at", "eye and at are exchanged");
  mistake.fix.swap_eye_at = true;
  list->push_back(mistake);
}

void AddCamera(std::vector<CandidateMistake>* list) {
  struct Factor {
    double factor;
    const char* told;
  };
  for (const Factor& f : {Factor{2, "2"},
                          {0.5, "1/2"},
                          {4, "4"},
                          {0.25, "1/4"},
                          {1.5, "3/2"},
                          {2.0 / 3, "2/3"},
                          {1.6, "1.6"},
                          {0.625, "1/1.6"},
                          {3, "3"},
                          {1.0 / 3, "1/3"}}) {
    CandidateMistake whole =
        OfSet(ProblemKind::kFocalFactor, absl::StrCat("camera x ", f.told),
              absl::StrCat("camera.yaml is of pictures of another size: fx, fy, cx and cy are ", f.told,
                           " times as large"));
    whole.fix.scale_camera = f.factor;
    list->push_back(whole);
    CandidateMistake focal =
        OfSet(ProblemKind::kFocalFactor, absl::StrCat("focal length x ", f.told),
              absl::StrCat("the focal length is ", f.told, " times that of camera.yaml"));
    focal.fix.scale_focal = f.factor;
    list->push_back(focal);
  }
}

// "rotation_deg=0,0,2", of values in SI.
std::string Assignment(const model::ParameterInfo& parameter, const double* values, int count) {
  std::vector<std::string> numbers;
  for (int i = 0; i < count; ++i)
    numbers.push_back(ShortestNumber(std::round(FromSi(parameter.unit, values[i]) * 1e6) / 1e6 + 0.0));
  return absl::StrCat(parameter.name, "=", absl::StrJoin(numbers, ","));
}

}  // namespace

std::vector<CandidateMistake> MistakesOfSets(const session::ImageSet& set) {
  std::vector<CandidateMistake> list;
  AddPictures(&list);
  if (set.size() > 4) AddRows(&list);
  AddUnits(&list);
  AddAxes(&list);
  AddCamera(&list);
  return list;
}

std::vector<CandidateMistake> MistakesOfModels(const model::Model& model) {
  std::vector<CandidateMistake> list;
  for (size_t e = 0; e < model.effects.size(); ++e) {
    const model::EffectInstance& instance = model.effects[e];
    if (instance.per_object || !(instance.effect->of_photos() || instance.effect->moves_surface)) continue;
    const bool angled = std::any_of(instance.effect->parameters.begin(), instance.effect->parameters.end(),
                                    [](const auto& parameter) { return parameter.unit == Unit::kDegree; });
    if (!angled) continue;
    for (const bool radians : {true, false}) {
      auto fixed = std::make_shared<model::Model>(model);
      std::vector<std::string> words;
      bool any = false;
      int at = 0;
      for (const model::ParameterInfo& parameter : instance.effect->parameters) {
        const int count = parameter.Count(model.fingers);
        double* values = &fixed->effects[e].values[at];
        for (int i = 0; i < count && parameter.unit == Unit::kDegree; ++i) {
          any |= values[i] != 0;
          values[i] *= radians ? 1 / kRadiansPerDegree : kRadiansPerDegree;
        }
        words.push_back(Assignment(parameter, values, count));
        at += count;
      }
      if (!any) continue;
      CandidateMistake mistake = OfSet(
          ProblemKind::kUnitsAngle, absl::StrCat(instance.effect->name, " x ", radians ? "180/pi" : "pi/180"),
          absl::StrCat("the model gives the angle of ", instance.effect->name, " in ",
                       radians ? "radians" : "degrees of degrees", ", where degrees are expected"));
      if (!radians)
        mistake.words = absl::StrCat("the angle of ", instance.effect->name,
                                     " was turned into degrees twice in the model");
      mistake.max_ratio = 0.1;  // a value of an effect may be wrong in any other way, too
      mistake.command = absl::StrCat("touchstone model remove MODEL ", instance.effect->name,
                                     " -o without.yaml && touchstone model add without.yaml ",
                                     instance.effect->name, " ", absl::StrJoin(words, " "), " -o fixed.yaml");
      mistake.model = fixed;
      list.push_back(mistake);
    }
  }
  return list;
}

}  // namespace touchstone::diagnosis::checks
