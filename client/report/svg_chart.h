// Small line, dot and step charts as inline SVG: linear axes with round ticks, styled by the page's classes.
#pragma once

#include <string>
#include <vector>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

struct Range {
  double low = 0, high = 1;
};

// The range of finite values, widened a little; never empty.
class RangeFinder {
 public:
  void Add(double value);
  Range Get(double margin = 0.04) const;

 private:
  bool any_ = false;
  double low_ = 0, high_ = 0;
};

// About `count` round numbers within the range.
std::vector<double> Ticks(Range range, int count);

struct ChartPoint {
  double x, y;
};

class Chart {
 public:
  struct Axis {
    std::string title;  // with the unit
    Range range;
  };
  // Sizes in px at scale 1; the picture scales with its place.
  Chart(double width, double height, std::string title, Axis x, Axis y);

  void Line(const std::vector<ChartPoint>& points, const std::string& css_class);
  void Dots(const std::vector<ChartPoint>& points, const std::string& css_class);
  // Vertical bars from y - size to y + size.
  void Whiskers(const std::vector<ChartPoint>& points, const std::vector<double>& sizes,
                const std::string& css_class);
  // A histogram's outline, filled down to zero.
  void Steps(const std::vector<double>& edges, const std::vector<double>& heights,
             const std::string& css_class);
  void ZeroLine();
  // Plain text beside a point, to its right.
  void Label(ChartPoint at, const std::string& text, const std::string& css_class);

  // `description` is the text alternative.
  std::string Svg(const std::string& description) const;

 private:
  std::string X(double x) const;
  std::string Y(double y) const;
  std::string Frame() const;

  double width_, height_, left_, right_, top_, bottom_;
  std::string title_;
  Axis x_, y_;
  std::string marks_;
};

// A value with its 95 % interval on a short line, zero marked; empty if the report has no interval.
std::string IntervalPicture(const v1::ParameterValue& parameter);

}  // namespace touchstone::client
