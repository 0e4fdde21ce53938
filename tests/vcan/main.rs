//! The CAN links on a real SocketCAN, against the kernel's own tools. They need vcan interfaces: `tests/vcan/run` boots
//! a kernel that has them, and runs these tests there, one after the other.
#![cfg(target_os = "linux")]

mod kernel;
