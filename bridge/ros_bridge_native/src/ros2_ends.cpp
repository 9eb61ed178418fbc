#include "ros2_ends.hpp"

#include <rcl/error_handling.h>

#include <cstring>
#include <stdexcept>

namespace plane {
namespace {

rmw_qos_profile_t profile(const Quality & quality) {
  rmw_qos_profile_t qos = rmw_qos_profile_default;
  qos.history = RMW_QOS_POLICY_HISTORY_KEEP_LAST;
  qos.depth = quality.depth;
  qos.reliability = quality.reliable ? RMW_QOS_POLICY_RELIABILITY_RELIABLE : RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  qos.durability = quality.latched ? RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL : RMW_QOS_POLICY_DURABILITY_VOLATILE;
  return qos;
}

void on_new_message(const void * arrived, size_t) { (*static_cast<const std::function<void()> *>(arrived))(); }

}  // namespace

void require(rcl_ret_t code, const char * what, const std::string & name) {
  if (code == RCL_RET_OK) return;
  const std::string reason = rcl_get_error_string().str;
  rcl_reset_error();
  throw std::runtime_error(std::string(what) + " " + name + ": " + reason);
}

Ros2Publisher::Ros2Publisher(rcl_node_t * node, const rosidl_message_type_support_t * type, const std::string & topic,
                             const Quality & quality)
: node_(node), publisher_(rcl_get_zero_initialized_publisher()) {
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  options.qos = profile(quality);
  require(rcl_publisher_init(&publisher_, node, type, topic.c_str(), &options), "can't publish", topic);
}

Ros2Publisher::~Ros2Publisher() {
  if (rcl_publisher_fini(&publisher_, node_) != RCL_RET_OK) rcl_reset_error();
}

bool Ros2Publisher::publish(const Program & program, const uint8_t * ros1, size_t size) {
  const Outgoing outgoing{&program, ros1, size, cdr_size(program, ros1, size)};
  if (outgoing.cdr_size == SIZE_MAX) return false;
  if (rcl_publish(&publisher_, &outgoing, nullptr) != RCL_RET_OK) {
    rcl_reset_error();
    return false;
  }
  return true;
}

size_t Ros2Publisher::peers() const {
  size_t number = 0;
  if (rcl_publisher_get_subscription_count(&publisher_, &number) != RCL_RET_OK) rcl_reset_error();
  return number;
}

Ros2Subscription::Ros2Subscription(rcl_node_t * node, const rosidl_message_type_support_t * type, const std::string & topic,
                                   const Quality & quality)
: node_(node), subscription_(rcl_get_zero_initialized_subscription()) {
  rcl_subscription_options_t options = rcl_subscription_get_default_options();
  options.qos = profile(quality);
  options.rmw_subscription_options.ignore_local_publications = true;  // what the bridge has published must not come back
  require(rcl_subscription_init(&subscription_, node, type, topic.c_str(), &options), "can't subscribe to", topic);
}

void Ros2Subscription::listen(std::function<void()> arrived) {
  arrived_ = std::move(arrived);
  require(rcl_subscription_set_on_new_message_callback(&subscription_, on_new_message, &arrived_), "can't listen to", "a subscription");
}

void Ros2Subscription::stop_listening() {
  if (rcl_subscription_set_on_new_message_callback(&subscription_, nullptr, nullptr) != RCL_RET_OK) rcl_reset_error();
}

Ros2Subscription::~Ros2Subscription() {
  stop_listening();
  if (rcl_subscription_fini(&subscription_, node_) != RCL_RET_OK) rcl_reset_error();
}

size_t Ros2Subscription::peers() const {
  size_t number = 0;
  if (rcl_subscription_get_publisher_count(&subscription_, &number) != RCL_RET_OK) rcl_reset_error();
  return number;
}

void Ros2Subscription::take(Incoming & incoming, Sender & sender) {
  rmw_message_info_t info = rmw_get_zero_initialized_message_info();
  const rcl_ret_t code = rcl_take(&subscription_, &incoming, &info, nullptr);
  if (code != RCL_RET_OK && code != RCL_RET_SUBSCRIPTION_TAKE_FAILED) rcl_reset_error();
  // rmw converts a message before it looks whether it is one of our own and drops it; with those it goes on until none is left.
  if (code == RCL_RET_SUBSCRIPTION_TAKE_FAILED && incoming.good) incoming.touched = false;
  std::memcpy(sender.gid.data(), info.publisher_gid.data, sender.gid.size());
  sender.sequence = info.publication_sequence_number;
}

}  // namespace plane
