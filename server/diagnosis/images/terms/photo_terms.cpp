#include "server/diagnosis/images/terms/photo_terms.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "server/base/units.h"
#include "server/diagnosis/images/terms/rules.h"
#include "server/effects/formula/formula.h"
#include "server/image/photograph/simulate_photo.h"

namespace touchstone::diagnosis::images {
namespace {

using Pixel = effects::PhotoPixel;

double FourDigits(double value) {
  return std::strtod(absl::StrFormat("%.4g", value).c_str(), nullptr);
}

class TermLister {
 public:
  explicit TermLister(const Photographs& photographs) {
    one_ = Function([](const Pixel&) { return 1.0; });
    const double height = photographs.height(), width = photographs.width();
    Plain("radius", "radius", 0, [](const Pixel& p) { return p.radius; });
    Plain("radius", "radius^2", 0, [](const Pixel& p) { return p.radius * p.radius; });
    Plain("radius", "radius^4", kPhotoTermRules.curved_nats,
          [](const Pixel& p) { return std::pow(p.radius, 4); });
    Plain("row", "row", 0, [](const Pixel& p) { return p.row; });
    Plain("column", "column", 0, [](const Pixel& p) { return p.column; });
    const std::string mid_row = absl::StrCat(0.5 * height), mid_column = absl::StrCat(0.5 * width);
    Plain("row", absl::StrCat("(row - ", mid_row, ")^2"), kPhotoTermRules.curved_nats,
          [mid = 0.5 * height](const Pixel& p) { return (p.row - mid) * (p.row - mid); });
    Plain("column", absl::StrCat("(column - ", mid_column, ")^2"), kPhotoTermRules.curved_nats,
          [mid = 0.5 * width](const Pixel& p) { return (p.column - mid) * (p.column - mid); });
    Plain(
        "grey", "grey", 0, [](const Pixel& p) { return p.grey; }, false);
    Plain(
        "grey", "grey^2", kPhotoTermRules.curved_nats, [](const Pixel& p) { return p.grey * p.grey; }, false);
    Plain("incidence_deg", "incidence_deg", 0, [](const Pixel& p) { return p.incidence_deg; });
    Plain("incidence_deg", "cos(incidence_deg*pi/180)", 0,
          [](const Pixel& p) { return std::cos(p.incidence_deg * kRadiansPerDegree); });
    Plain("incidence_deg", "cos(incidence_deg*pi/180)^2", kPhotoTermRules.curved_nats,
          [](const Pixel& p) { return std::pow(std::cos(p.incidence_deg * kRadiansPerDegree), 2); });
    Plain("depth_mm", "depth_mm", 0, [](const Pixel& p) { return p.depth_mm; });
    for (int waves = 1; waves <= kPhotoTermRules.max_waves; ++waves) {
      Wave("row", height / waves, [](const Pixel& p) { return p.row; });
      Wave("column", width / waves, [](const Pixel& p) { return p.column; });
    }
    AddTimes(photographs);
  }

  PhotoTermDictionary Take() { return std::move(dictionary_); }

 private:
  int Function(PixelFunction function) {
    dictionary_.functions.push_back(std::move(function));
    return static_cast<int>(dictionary_.functions.size()) - 1;
  }

  void AddTimes(const Photographs& photographs) {
    if (!photographs.set->has_session_time) return;
    double first = INFINITY, last = -INFINITY;
    for (int k = 0; k < photographs.size(); ++k)
      first = std::min(first, photographs.TimeOf(k)), last = std::max(last, photographs.TimeOf(k));
    if (!(last > first)) return;
    Plain("session_time_s", "session_time_s", 0, [](const Pixel& p) { return p.session_time_s; });
    for (const double share : {0.1, 0.3, 1.0}) {
      const double tau = FourDigits(share * (last - first));
      const int f = Function([tau](const Pixel& p) { return std::exp(-p.session_time_s / tau); });
      for (const bool grey : {false, true})
        for (const bool constant : {false, true})
          Add("session_time_s", "exp(-session_time_s/tau)", f, grey, constant, kPhotoTermRules.curved_nats,
              "tau", tau);
    }
    for (int waves = 1; waves <= kPhotoTermRules.max_waves; ++waves)
      Wave("session_time_s", (last - first) / waves, [](const Pixel& p) { return p.session_time_s; });
  }

  void Plain(const std::string& covariate, const std::string& text, double penalty, PixelFunction function,
             bool with_grey = true) {
    const int f = Function(std::move(function));
    for (const bool grey : {false, true})
      for (const bool constant : {false, true})
        if (!grey || with_grey) Add(covariate, text, f, grey, constant, penalty, "", 0);
  }

  void Add(const std::string& covariate, const std::string& text, int function, bool grey, bool constant,
           double penalty, const std::string& fixed_name, double fixed_value) {
    PhotoTerm term;
    term.covariate = covariate;
    term.expression = absl::StrCat("k * ", grey ? "grey * " : "", text);
    term.linear = {"k"};
    term.columns = {{function, grey}};
    if (constant) {
      absl::StrAppend(&term.expression, " + c", grey ? " * grey" : "");
      term.linear.push_back("c");
      term.columns.push_back({one_, grey});
    }
    term.fixed_name = fixed_name;
    term.fixed_value = fixed_value;
    term.penalty_nats = penalty + (grey ? kPhotoTermRules.curved_nats.value() : 0);
    dictionary_.terms.push_back(std::move(term));
  }

  void Wave(const std::string& covariate, double period, double (*value)(const Pixel&)) {
    period = FourDigits(period);
    const double turn = 2 * M_PI / period;
    const int sine = Function([=](const Pixel&p) { return std::sin(turn * value(p)); }),
              cosine = Function([=](const Pixel&p) { return std::cos(turn * value(p)); });
    for (const bool grey : {false, true}) {
      PhotoTerm term;
      term.covariate = covariate;
      const std::string angle = absl::StrCat("2*pi*", covariate, "/period");
      term.expression = absl::StrCat(grey ? "grey * (" : "", "k * sin(", angle, ") + q * cos(", angle, ")",
                                     grey ? ")" : "");
      term.linear = {"k", "q"};
      term.columns = {{sine, grey}, {cosine, grey}};
      term.fixed_name = "period";
      term.fixed_value = period;
      term.penalty_nats = kPhotoTermRules.wave_nats + (grey ? kPhotoTermRules.curved_nats.value() : 0);
      dictionary_.terms.push_back(std::move(term));
    }
  }

  PhotoTermDictionary dictionary_;
  int one_ = 0;
};

// Bounds that hold the value with room to spare, and zero where it is linear.
model::ParameterInfo ParameterAround(const std::string& name, double value, bool fixed) {
  model::ParameterInfo parameter;
  parameter.name = name;
  const double room = std::pow(10, std::ceil(std::log10(std::max(std::abs(value), 1e-12))) + 1);
  parameter.lower = fixed ? FourDigits(0.5 * value) : -room;
  parameter.upper = fixed ? FourDigits(2 * value) : room;
  return parameter;
}

}  // namespace

PhotoTermDictionary MakePhotoTerms(const Photographs& photographs) {
  return TermLister(photographs).Take();
}

absl::StatusOr<std::shared_ptr<const model::Effect>> MakePhotoTermEffect(const PhotoTerm& term,
                                                                         const std::vector<double>& values) {
  model::FormulaSpec spec;
  spec.name = absl::StrCat("rest_", term.covariate);
  spec.adds_grey = true;
  spec.stage = model::Stage::kImageSensor;
  spec.expression = term.expression;
  for (size_t i = 0; i < values.size(); ++i) {
    spec.values.push_back(FourDigits(values[i]));
    spec.parameters.push_back(ParameterAround(term.linear[i], spec.values.back(), false));
  }
  if (!term.fixed_name.empty()) {
    spec.values.push_back(term.fixed_value);
    spec.parameters.push_back(ParameterAround(term.fixed_name, term.fixed_value, true));
  }
  return effects::MakeFormulaEffect(spec);
}

PixelReader::PixelReader(const Photographs& photographs, const model::Model& model, int k,
                         const image::Photo& photo)
    : photo_(photo) {
  const image::PhotoRequest& request = photographs.requests[k];
  const effects::PhotoSettings settings =
      image::PhotoSimulator(std::make_shared<const model::Model>(model)).SettingsFor(request.object);
  cx_px_ = request.lens.cx_px + settings.principal_point_offset_px.x();
  cy_px_ = request.lens.cy_px + settings.principal_point_offset_px.y();
  half_diagonal_px_ = 0.5 * std::hypot(request.lens.width, request.lens.height);
  session_time_s_ = request.session_time_s;
}

effects::PhotoPixel PixelReader::At(int column, int row) const {
  const size_t at = static_cast<size_t>(row) * photo_.width + column;
  effects::PhotoPixel pixel;
  pixel.column = column + 0.5, pixel.row = row + 0.5;
  pixel.radius = std::hypot(pixel.column - cx_px_, pixel.row - cy_px_) / half_diagonal_px_;
  pixel.grey = photo_.grey[at];
  const bool object = photo_.mask[at] != 0;
  pixel.incidence_deg = object ? photo_.incidence_rad[at] / kRadiansPerDegree : 90;
  pixel.depth_mm = object ? photo_.depth_m[at] * kMillimetresPerMetre : 0;
  pixel.session_time_s = session_time_s_;
  return pixel;
}

}  // namespace touchstone::diagnosis::images
