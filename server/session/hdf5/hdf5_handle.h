// An HDF5 handle with the function that closes it.
#pragma once

#include <hdf5.h>

#include <utility>

namespace touchstone::session {

class Hdf5Handle {
 public:
  Hdf5Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept : id_(other.id_), close_(other.close_) { other.id_ = -1; }
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Hdf5Handle() { Close(); }
  bool ok() const { return id_ >= 0; }
  operator hid_t() const { return id_; }
  bool Close() {
    if (id_ < 0) return true;
    const bool closed = close_(id_) >= 0;
    id_ = -1;
    return closed;
  }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

}  // namespace touchstone::session
