#include "client/report/sample_evidence.h"

#include <array>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "server/base/numbers/random.h"
#include "server/base/units.h"

namespace touchstone::client {
namespace {

using Point = std::array<double, 3>;

// A bumpy ball with `lobes` lobes, about 80 mm across: the point in direction (latitude, longitude).
Point OnObject(int lobes, double latitude, double longitude) {
  const double r = 38 + 6 * std::cos(lobes * longitude) * std::cos(latitude) * std::cos(latitude);
  return {r * std::cos(latitude) * std::cos(longitude), r * std::cos(latitude) * std::sin(longitude),
          0.8 * r * std::sin(latitude)};
}

void AddOutline(const std::string& name, int lobes, v1::DataReport* data) {
  constexpr int kRings = 9, kSectors = 20;
  v1::ObjectOutline* outline = data->add_outlines();
  outline->set_object(name);
  for (int i = 0; i <= kRings; ++i) {
    for (int j = 0; j < kSectors; ++j) {
      const Point p = OnObject(lobes, kPi * (static_cast<double>(i) / kRings - 0.5), 2 * kPi * j / kSectors);
      for (double x : p) outline->add_vertices_mm(static_cast<float>(x));
    }
  }
  for (int i = 0; i < kRings; ++i) {
    for (int j = 0; j < kSectors; ++j) {
      const int a = i * kSectors + j, b = i * kSectors + (j + 1) % kSectors;
      for (int corner : {a, b, b + kSectors, a, b + kSectors, a + kSectors}) outline->add_triangles(corner);
    }
  }
}

void AddHistogram(v1::Histogram::Quantity quantity, const std::string& object, double spread, double shift,
                  v1::DataReport* data) {
  v1::Histogram* histogram = data->add_histograms();
  histogram->set_quantity(quantity);
  histogram->set_object(object);
  constexpr int kBins = 24;
  const auto density = [&](double x, double centre, double width) {
    return std::exp(-0.5 * std::pow((x - centre) / width, 2)) / (width * std::sqrt(2 * kPi));
  };
  for (int i = 0; i <= kBins; ++i) histogram->add_edges(spread * (6.0 * i / kBins - 1));
  for (int i = 0; i < kBins; ++i) {
    const double x = spread * (6.0 * (i + 0.5) / kBins - 1);
    histogram->add_measured(density(x, spread * 1.6, spread) * (1 + 0.15 * std::sin(3.0 * i)));
    histogram->add_simulated(density(x, spread * (1.6 + shift), spread * 0.8));
    histogram->add_improved(density(x, spread * 1.6, spread * 0.98));
  }
  histogram->set_p_simulated(0.0002);
  histogram->set_p_improved(0.47);
}

void AddCurve(const char* covariate, const char* unit, double from, double to, double size_us,
              double floor_us, double p, v1::DataReport* data) {
  v1::CovariateCurve* curve = data->add_curves();
  curve->set_covariate(covariate);
  curve->set_unit(unit);
  curve->set_p(p);
  RandomStream random(11, RandomDomain::kTest, data->curves_size());
  for (int finger = 0; finger < data->fingers_size(); ++finger) {
    for (int i = 0; i < 12; ++i) {
      const double u = (i + 0.5) / 12;
      v1::CurveBin* bin = curve->add_bins();
      bin->set_centre(from + (to - from) * u);
      bin->set_mean_residual(size_us * (finger - 1) * (p < 0.01 ? u * u : 0) +
                             floor_us * 0.1 * random.Normal());
      bin->set_std_error(floor_us * 0.12);
      bin->set_after(floor_us * 0.12 * random.Normal());
      bin->set_count(80);
      bin->set_finger(data->fingers(finger));
    }
  }
}

void AddGroup(v1::GroupError::Kind kind, const std::string& name, uint32_t touches, double rmse_us,
              double share, v1::DataReport* data) {
  v1::GroupError* group = data->add_groups();
  group->set_kind(kind);
  group->set_name(name);
  group->set_count(touches);
  group->set_rmse(rmse_us);
  group->set_mean_residual(rmse_us * 0.3);
  group->set_share_of_excess_error(share);
}

void AddGroups(double initial_us, v1::DataReport* data) {
  const int objects = data->set().objects_size();
  for (int i = 0; i < objects; ++i) {
    AddGroup(v1::GroupError::OBJECT, data->set().objects(i), 960 / objects, initial_us * (0.7 + 0.3 * i),
             1.0 / objects, data);
  }
  for (const char* face : {"front", "back", "left", "right", "top", "bottom"}) {
    AddGroup(v1::GroupError::FACE, face, 160, initial_us * (face[0] == 't' ? 0.4 : 1.05),
             face[0] == 't' ? 0.05 : 0.19, data);
  }
  for (const std::string& finger : data->fingers()) {
    AddGroup(v1::GroupError::FINGER, finger, 960, finger == "m" ? initial_us * 1.2 : initial_us * 0.9,
             1.0 / 3, data);
  }
  for (int round = 1; round <= 4; ++round) {
    AddGroup(v1::GroupError::ROUND, absl::StrCat(round), 240, initial_us * (1 + 0.01 * round), 0.25, data);
  }
  for (int i = 0; i < 8; ++i) {
    v1::TouchError* touch = data->add_worst_touches();
    touch->set_touch(900 - 37 * i);
    touch->set_object(data->set().objects(i % objects));
    const double size = 3.4 * initial_us - 0.1 * initial_us * i;
    touch->add_residual(-0.4 * size);
    touch->add_residual(i == 3 ? std::nan("") : 0.8 * size);
    touch->add_residual(-0.4 * size);
    touch->set_norm(size);
  }
}

}  // namespace

void AddHistograms(double spread_us, v1::DataReport* data) {
  AddHistogram(v1::Histogram::TOUCH_DESCRIPTOR, "", spread_us, 0.4, data);
  AddHistogram(v1::Histogram::CURVATURE_PER_M, "", 6, -0.5, data);
  for (const std::string& object : data->set().objects()) {
    AddHistogram(v1::Histogram::TOUCH_DESCRIPTOR, object, spread_us, 0.3, data);
    AddHistogram(v1::Histogram::CURVATURE_PER_M, object, 6, -0.4, data);
  }
}

void AddEvidence(double initial_us, double floor_us, v1::DataReport* data) {
  RandomStream random(7, RandomDomain::kTest);
  const int objects = data->set().objects_size();
  for (int i = 0; i < objects; ++i) AddOutline(data->set().objects(i), 2 + 2 * i, data);
  for (int touch = 0; touch < 960; ++touch) {
    const int object = touch % objects;
    const double latitude = 1.3 * (2 * random.Uniform() - 1), longitude = 2 * kPi * random.Uniform();
    for (uint32_t finger = 0; finger < 3; ++finger) {
      const double around = longitude + 0.3 * (static_cast<int>(finger) - 1);
      const Point point = OnObject(2 + 2 * object, latitude, around);
      const double structure = initial_us * 1.4 * std::sin((2 + 2 * object) * around) * std::cos(latitude);
      const double noise = floor_us * random.Normal();
      v1::SurfacePoint* surface = data->add_surface_points();
      surface->set_object(data->set().objects(object));
      surface->set_x_mm(point[0]);
      surface->set_y_mm(point[1]);
      surface->set_z_mm(point[2]);
      surface->set_residual((initial_us > 1.1 * floor_us ? structure : 0) + noise);
      surface->set_after(noise);
      surface->set_finger(finger);
      v1::ParityPoint* parity = data->add_parity();
      parity->set_finger(finger);
      parity->set_simulated(400000 * std::pow(random.Uniform(), 2));
      parity->set_measured(parity->simulated() + surface->residual());
      parity->set_improved(parity->measured() - noise);
    }
  }
  AddCurve("incidence_deg", "deg", 0, 40, initial_us, floor_us, 1e-9, data);
  AddCurve("travel_mm", "mm", 20, 120, initial_us, floor_us, 0.002, data);
  AddCurve("curvature_per_m", "1/m", -10, 60, initial_us, floor_us, 0.31, data);
  AddCurve("session_time_s", "s", 0, 5400, initial_us, floor_us, 0.8, data);
  AddGroups(initial_us, data);
  AddHistograms(initial_us, data);
}

void AddProposals(int touches, const char* purpose, v1::Report* report) {
  RandomStream random(9, RandomDomain::kTest);
  for (int i = 0; i < touches; ++i) {
    v1::NextMeasurement* proposed = report->add_next();
    proposed->set_object(report->data(0).set().objects(i % report->data(0).set().objects_size()));
    proposed->set_purpose(purpose);
    proposed->set_separation(6.2 - 0.2 * i);
    const double latitude = 0.9 * (2 * random.Uniform() - 1), longitude = 2 * kPi * random.Uniform();
    v1::CommandedTouch* touch = proposed->mutable_touch();
    touch->mutable_target_m();
    touch->mutable_approach()->set_x(-std::cos(latitude) * std::cos(longitude));
    touch->mutable_approach()->set_y(-std::cos(latitude) * std::sin(longitude));
    touch->mutable_approach()->set_z(-std::sin(latitude));
    touch->mutable_lateral()->set_x(-std::sin(longitude));
    touch->mutable_lateral()->set_y(std::cos(longitude));
    touch->set_standoff_m(0.12);
    touch->set_speed_m_s(i % 2 == 0 ? 0.01 : 0.04);
  }
}

}  // namespace touchstone::client
