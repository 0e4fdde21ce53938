//! Packets over CAN: frames and their time on the bus, ISO-TP, the CAN form, nodes over good and
//! bad channels, slcan.

mod bus;
mod form;
mod frame;
mod isotp;
mod node;
mod slcan;
mod upset;
