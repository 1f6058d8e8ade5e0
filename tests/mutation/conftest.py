"""A small program with mutants and GoogleTests, as the tool makes them."""

import pathlib
import subprocess
import sys

import pytest

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

LIBRARY = """// 1 < 2 in a comment
#include <array>
#include <cstdlib>
#define TWICE(x) ((x) + (x))
enum Kind { kFirst = 1, kSecond = 1 + 1 };
constexpr int kSize = 3;
constexpr bool Small(int x) { return x < kSize; }
static_assert(sizeof(int) == 4, "as everywhere");
template <int kN = 7>
int Count(int more = 5) {
  std::array<int, 4> values{};
  if constexpr (kN > 2) more += kN;
  switch (more) {
    case 8: return -1;
    default: return more * static_cast<int>(values.size());
  }
}
double Half(double x) { return 0.5 * x; }
bool Between(int x, int low, int high) {
  return low <= x && x < high;
}
int Hang(int from) {
  int steps = 0;
  for (int i = from; i > 0; i -= 1) ++steps;
  return steps;
}
const char* Text() { return "a < b"; }
int Macro(int x) { return TWICE(x); }
int Never(int x) {
  std::abort();
  return x;
}
"""
TESTS = """#include <gtest/gtest.h>
#include "library.cpp"
#include "server/base/test_tier.h"
TEST(Half, IsHalf) { EXPECT_EQ(Half(4), 2); }
TEST(Between, HasAnEnd) { EXPECT_FALSE(Between(3, 1, 3)); }
TEST(Hang, Counts) { EXPECT_EQ(Hang(3), 3); }
TEST(Count, Multiplies) {
  TOUCHSTONE_SECOND_TIER("long: not really");
  EXPECT_EQ(Count<7>(5), 48);
}
TEST(Text, SkipsItself) { GTEST_SKIP(); }
TEST(Crash, OfTheProgram) {
  if (!Between(1, 1, 3)) std::abort();
}
"""


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    """The library's file as libclang reads it."""
    import cpp_sites
    path = tmp_path_factory.mktemp("library") / "library.cpp"
    path.write_text(LIBRARY)
    return cpp_sites.File(path, path, ["-std=c++17", f"-I{HERE.parents[1]}"])


@pytest.fixture(scope="session")
def program(library, tmp_path_factory):
    """(GoogleTests of a program with every site of the library as a mutant, {(line, original): number})."""
    import cpp_sites
    import sites
    import suites
    folder = tmp_path_factory.mktemp("program")
    text, numbers, found = library.source, {}, library.sites()
    # From the back, so that places before stay; what lies within another site is left out.
    end = len(text)
    for number in reversed(range(len(found))):
        site = found[number]
        if site.end > end or any(other.begin <= site.begin and site.end <= other.end for other in found if other is not site):
            continue
        mutant = sites.Mutant(library.path, site, site.changes[0])
        if not library.compiles(number, mutant):
            continue
        text = cpp_sites.mutated(text, number, mutant).removeprefix(cpp_sites.INCLUDE)
        numbers[site.line, site.original], end = number, site.begin
    (folder / "library.cpp").write_bytes(cpp_sites.INCLUDE + text)
    (folder / "all_test.cpp").write_text(TESTS)
    # Two seconds: it compiles GoogleTest's headers.
    subprocess.run(["g++", "-std=c++17", f"-I{HERE.parents[1]}", "all_test.cpp", "-o", "all_test", "-lgtest", "-lgtest_main", "-lpthread"],
                   cwd=folder, check=True)
    return suites.GoogleTests("all_test", [str(folder / "all_test")], folder, {}, False), numbers
